"""Clean simulated runs, read back as files are, and tools to spoil them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from app.files.machines import load_machine
from calib.arrays import Array, BoolArray, IntArray
from calib.frames import Frame, align
from calib.identify.staged import fit_effects
from calib.mechanism.description import Machine
from calib.mechanism.solve import forward
from calib.model.prototype import prototype_run
from calib.poses import sample_poses
from calib.runs import parse_run
from calib.runs.record import Run
from calib.runs.stack import stack
from mocks.arguments import MACHINES
from mocks.hidden.table import Hidden
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

PROFILE = Profile(rise_K=5.0, payload_kg=(0.0, 6.0))
_PER_ROW = ("line", "time_s", "q", "measured", "position", "covariance")


@lru_cache(maxsize=8)
def machine_named(name: str) -> Machine:
    """A shipped machine, loaded once."""
    return load_machine(name)


def clean_run(
    machine: str, seed: int, *, poses: int = 40, order: str = "nest-by-nest",
    hidden: Mapping[str, float] | None = None, profile: Profile = PROFILE, noise_mm: float = 0.005,
) -> Run:  # fmt: skip
    """A simulated run, 5 um an axis, read back as a file is read.

    A machine that there is no mock of is a virtual prototype, without hidden effects.
    """
    if machine not in MACHINES:
        return _prototype(machine, seed, poses, order, noise_mm)
    plan = RunPlan(
        machine=machine,
        seed=seed,
        poses=poses,
        order=order,  # type: ignore[arg-type]
        hidden=Hidden(dict(hidden or {})),
        profile=profile,
        noise_mm=noise_mm,
    )
    return read_back(simulate(plan), machine)


def _prototype(name: str, seed: int, poses: int, order: str, noise_mm: float) -> Run:
    """A prototype's run with temperatures and a payload, nest by nest or pose by pose."""
    machine, generator = machine_named(name), np.random.default_rng([seed, 5])
    chosen = sample_poses(machine, poses, generator)
    off = np.clip(generator.normal(size=machine.nominal.size), -2.0, 2.0)
    parameters = machine.nominal + 0.7 * machine.prior_sigma * off
    run = prototype_run(machine, name, chosen, parameters, noise_mm, generator).run
    share = run.time_s / run.time_s[-1]
    wander = generator.normal(size=share.size)
    run = replace(
        run,
        position=np.round(run.position, 6),
        channels={
            "structure_temp_C": np.round(20.0 + 5.0 * share + 0.02 * wander, 3),
            "air_temp_C": np.round(20.4 + 0.05 * generator.normal(size=share.size), 3),
            "payload_kg": np.where(share > 0.5, 6.0, 0.0),
        },
    )
    if order == "nest-by-nest":
        return run
    platform = [k for k in range(run.line.size) if run.nest[k] in run.header.platform_nests]
    platform.sort(key=lambda k: int(run.pose[k]))
    visits = [k for k in range(run.line.size) if run.nest[k] in run.header.base_nests]
    half = len(platform) // 2 // 3 * 3
    rows = [0, *visits[:8], *platform[:half], *visits[8:12], *platform[half:], *visits[12:]]
    shuffled = in_order(run, rows)
    return replace(shuffled, time_s=run.time_s, channels=run.channels)


def read_back(made: SimulatedRun, machine: str) -> Run:
    """A simulated run as a file of it is read."""
    actuators = len(machine_named(machine).actuators)
    return parse_run(run_toml(made), points_csv(made), actuators=actuators)


def read_rows(run: Run) -> IntArray:
    """Indices of the rows with readings."""
    return np.flatnonzero(run.measured)


def read_nests(run: Run) -> list[str]:
    """Nests on the platform that were read."""
    return [name for name in run.header.platform_nests if name in run.nest]


def on_platform(run: Run) -> BoolArray:
    """Which rows are readings on the platform."""
    return np.array([name in run.header.platform_nests for name in run.nest]) & run.measured


def at_rows(run: Run, rows: IntArray) -> BoolArray:
    """The rows as a mask."""
    which = np.zeros(run.line.size, dtype=bool)
    which[rows] = True
    return which


def from_part(run: Run, part: float) -> BoolArray:
    """Readings from a part (0..1) of the run on."""
    read = read_rows(run)
    return at_rows(run, read[int(part * read.size) :])


def with_channel(run: Run, name: str, values: Array) -> Run:
    """The run with a column that holds ``values`` (N,)."""
    return replace(run, channels={**run.channels, name: values})


def with_header(run: Run, **changes: object) -> Run:
    """The run with other entries in its header."""
    return replace(run, header=replace(run.header, **changes))


def in_order(run: Run, rows: Sequence[int] | IntArray, *, timed: bool = False) -> Run:
    """The rows in another order, each as often as named; times stay in order unless ``timed``."""
    chosen = np.asarray(rows)
    told = {name: getattr(run, name)[..., chosen] for name in _PER_ROW}
    times = run.time_s[chosen] if timed else np.interp(
        np.linspace(0, 1, chosen.size), np.linspace(0, 1, run.line.size), run.time_s
    )  # fmt: skip
    return replace(
        run,
        **{**told, "line": np.arange(2, 2 + chosen.size), "time_s": times},
        pose=tuple(run.pose[k] for k in chosen),
        nest=tuple(run.nest[k] for k in chosen),
        channels={name: values[chosen] for name, values in run.channels.items()},
    )


def moved_by(
    run: Run, which: BoolArray, size_mm: float, generator: np.random.Generator, turn: float = 2e-4
) -> Run:
    """Readings moved rigidly, by ``size_mm`` and ``turn`` rad a millimetre, one way at random."""
    shift = generator.normal(size=3)
    shift *= size_mm / np.linalg.norm(shift)
    frame = Frame.of([0.0, 0.0, 0.0, *(generator.normal(size=3) * turn * size_mm)])
    middle = run.position[:, run.measured].mean(axis=1)
    position = run.position.copy()
    position[:, which] = (
        frame.apply(position[:, which] - middle[:, None]) + (middle + shift)[:, None]
    )
    return replace(run, position=position)


def base_frame(run: Run) -> tuple[Array, Array]:
    """Rotation (3, 3) and position (3,) of the base in the tracker frame, by the base nests."""
    rows = [k for k in read_rows(run) if run.nest[k] in run.header.base_nests]
    drawn = np.array([run.header.base_nests[run.nest[k]] for k in rows]).T
    return align(drawn, run.position[:, rows])


def platform_turns(run: Run, machine: Machine) -> Array:
    """Rotations (3, 3, N) of the nominal platform in the tracker frame."""
    poses = forward(machine, machine.extension(run.q, run.header.controller_parameters)).poses
    return np.einsum("ij,jkn->ikn", base_frame(run)[0], poses.rotation)


def moved_actuators(run: Run, machine: Machine, change: Array) -> Run:
    """Readings as they would be had the actuators gone ``change`` (n, N) farther than said.

    The machine is that of a fit: the nominal one bends large changes by too much.
    """
    held = run.header.controller_parameters
    rotation, _ = base_frame(run)
    true = fit_effects(stack(machine, [run]), []).linear.state.parameters
    there = forward(machine, machine.extension(run.q + change, held), true).poses
    here = forward(machine, machine.extension(run.q, held), true).poses
    nests = np.array(
        [run.header.platform_nests.get(name, np.full(3, np.nan)) for name in run.nest]
    ).T
    apart = there.position - here.position
    apart = apart + np.einsum("ijn,jn->in", there.rotation - here.rotation, nests)
    which = on_platform(run)
    position = run.position.copy()
    position[:, which] += (rotation @ apart)[:, which]
    return replace(run, position=position)
