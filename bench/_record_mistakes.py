"""Everyday mistakes put into a clean run: one function each, run in, run out."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from app.files.machines import load_machine
from calib.arrays import BoolArray
from calib.frames import Frame
from calib.mechanism.description import Machine
from calib.runs import parse_run
from calib.runs.record import Run
from mocks.hidden.table import Hidden
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

Mistake = Callable[[Run, np.random.Generator], Run]
PROFILE = Profile(rise_K=5.0, payload_kg=(0.0, 6.0))


@lru_cache(maxsize=4)
def machine_named(name: str) -> Machine:
    """A shipped machine, loaded once."""
    return load_machine(name)


def clean_run(
    machine: str, seed: int, *, poses: int = 40, order: str = "nest-by-nest",
    hidden: Mapping[str, float] | None = None, profile: Profile = PROFILE,
) -> Run:  # fmt: skip
    """A simulated run, 5 um an axis, read back as a file is read."""
    plan = RunPlan(
        machine=machine,
        seed=seed,
        poses=poses,
        order=order,  # type: ignore[arg-type]
        hidden=Hidden(dict(hidden or {})),
        profile=profile,
    )
    return read_back(simulate(plan), machine)


def read_back(made: SimulatedRun, machine: str) -> Run:
    """A simulated run as a file of it is read."""
    actuators = len(machine_named(machine).actuators)
    return parse_run(run_toml(made), points_csv(made), actuators=actuators)


def _read(run: Run) -> np.ndarray:
    """Indices of the rows with readings."""
    return np.flatnonzero(run.measured)


def _at(run: Run, rows: np.ndarray) -> BoolArray:
    which = np.zeros(run.line.size, dtype=bool)
    which[rows] = True
    return which


def _with_channel(run: Run, name: str, values: np.ndarray) -> Run:
    return replace(run, channels={**run.channels, name: values})


def _moved_by(run: Run, part: float, size: float, generator: np.random.Generator) -> Run:
    read = _read(run)
    late = read[int(part * read.size) :]
    shift = generator.normal(size=3)
    shift *= size / np.linalg.norm(shift)
    turn = generator.normal(size=3) * 2e-4 * size
    middle = run.position[:, read].mean(axis=1)
    frame = Frame.of([0.0, 0.0, 0.0, *turn])
    position = run.position.copy()
    position[:, late] = frame.apply(position[:, late] - middle[:, None]) + (middle + shift)[:, None]
    return replace(run, position=position)


def zeros_at_the_start(run: Run, generator: np.random.Generator) -> Run:
    """The first tenth reads 0, 0, 0."""
    read = _read(run)
    position = run.position.copy()
    position[:, read[: read.size // 10]] = 0.0
    return replace(run, position=position)


def stale(run: Run, generator: np.random.Generator) -> Run:
    """From two thirds on every reading is the same."""
    read = _read(run)
    late = read[2 * read.size // 3 :]
    position = run.position.copy()
    position[:, late] = position[:, [late[0]]]
    return replace(run, position=position)


def each_row_twice(run: Run, generator: np.random.Generator) -> Run:
    """Every row stands twice."""
    twice = np.repeat(np.arange(run.line.size), 2)
    return replace(
        run,
        line=np.arange(2, 2 + twice.size),
        time_s=run.time_s[twice],
        pose=tuple(run.pose[k] for k in twice),
        nest=tuple(run.nest[k] for k in twice),
        q=run.q[:, twice],
        measured=run.measured[twice],
        position=run.position[:, twice],
        covariance=run.covariance[:, :, twice],
        channels={name: values[twice] for name, values in run.channels.items()},
    )


def nests_exchanged(run: Run, generator: np.random.Generator) -> Run:
    """Two labels of the platform are exchanged throughout."""
    first, second = generator.choice(list(run.header.platform_nests), 2, replace=False)
    other = {first: str(second), second: str(first)}
    return replace(run, nest=tuple(other.get(name, name) for name in run.nest))


def nests_exchanged_late(run: Run, generator: np.random.Generator) -> Run:
    """The same from the middle on."""
    changed = nests_exchanged(run, generator)
    half = run.line.size // 2
    return replace(run, nest=run.nest[:half] + changed.nest[half:])


def nests_mirrored(run: Run, generator: np.random.Generator) -> Run:
    """The table is mirrored: x of every platform nest has the other sign."""
    flip = np.array([-1.0, 1.0, 1.0])
    table = {name: flip * nest for name, nest in run.header.platform_nests.items()}
    return replace(run, header=replace(run.header, platform_nests=table))


def kelvin(run: Run, generator: np.random.Generator) -> Run:
    """The structure's temperature in kelvin."""
    values = run.channels["structure_temp_C"]
    return _with_channel(run, "structure_temp_C", values + 273.15)


def fahrenheit(run: Run, generator: np.random.Generator) -> Run:
    """The structure's temperature in degrees Fahrenheit."""
    values = run.channels["structure_temp_C"]
    return _with_channel(run, "structure_temp_C", np.round(1.8 * values + 32.0, 2))


def tenths(run: Run, generator: np.random.Generator) -> Run:
    """The structure's temperature in tenths of a degree."""
    values = run.channels["structure_temp_C"]
    return _with_channel(run, "structure_temp_C", np.round(10.0 * values))


def sensor_lost(run: Run, generator: np.random.Generator) -> Run:
    """Three values of -127."""
    values = run.channels["structure_temp_C"].copy()
    values[generator.choice(values.size, 3, replace=False)] = -127.0
    return _with_channel(run, "structure_temp_C", values)


def sensor_stuck(run: Run, generator: np.random.Generator) -> Run:
    """The sensor stands still from the middle on."""
    values = run.channels["structure_temp_C"].copy()
    half = values.size // 2
    values[half:] = values[half]
    return _with_channel(run, "structure_temp_C", values)


def payload_in_grams(run: Run, generator: np.random.Generator) -> Run:
    """The payload in grams."""
    return _with_channel(run, "payload_kg", 1000.0 * run.channels["payload_kg"])


def gravity_in_g(run: Run, generator: np.random.Generator) -> Run:
    """Gravity written in g."""
    load = run.header.load
    assert load is not None
    changed = replace(load, gravity=load.gravity / 9.80665)
    return replace(run, header=replace(run.header, load=changed))


def sigmas_in_um(run: Run, generator: np.random.Generator) -> Run:
    """Uncertainties written in um."""
    return replace(run, covariance=1e6 * run.covariance)


def three_sigmas_in_um(run: Run, generator: np.random.Generator) -> Run:
    """Three of them."""
    rows = generator.choice(_read(run), 3, replace=False)
    factor = np.where(_at(run, rows), 1e6, 1.0)
    return replace(run, covariance=factor * run.covariance)


def moved_far(run: Run, generator: np.random.Generator) -> Run:
    """The tracker moved by 20 to 50 mm at some moment."""
    return _moved_by(run, generator.uniform(0.1, 0.9), generator.uniform(20.0, 50.0), generator)


def moved_late(run: Run, generator: np.random.Generator) -> Run:
    """The tracker moved by 10 mm after 95 %."""
    return _moved_by(run, 0.95, 10.0, generator)


def moved_little(run: Run, generator: np.random.Generator) -> Run:
    """The tracker moved by 0.2 to 1 mm at some moment."""
    return _moved_by(run, generator.uniform(0.1, 0.9), generator.uniform(0.2, 1.0), generator)


def other_smr(run: Run, generator: np.random.Generator) -> Run:
    """One nest is read with an SMR 0.5 to 3 mm larger in radius."""
    name = str(generator.choice(list(run.header.platform_nests)))
    at = np.array([nest == name for nest in run.nest]) & run.measured
    frame, _ = frame_of(run)
    lift = frame[:, 2] * generator.uniform(0.5, 3.0)
    return replace(run, position=run.position + np.where(at, lift[:, None], 0.0))


def frame_of(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and position of the base in the tracker frame, by the base nests."""
    from calib.frames import align

    rows = [k for k in _read(run) if run.nest[k] in run.header.base_nests]
    drawn = np.array([run.header.base_nests[run.nest[k]] for k in rows]).T
    return align(drawn, run.position[:, rows])


def label_shared(run: Run, generator: np.random.Generator) -> Run:
    """The second pose bears the label of the first."""
    labels = list(dict.fromkeys(label for label in run.pose if label and label != "home"))
    first, second = labels[:2]
    return replace(run, pose=tuple(first if p == second else p for p in run.pose))


MISTAKES: Mapping[str, tuple[Mistake, str]] = {
    "zeros at the start": (zeros_at_the_start, "zero-readings"),
    "readings no longer change": (stale, "stale-readings"),
    "each row twice": (each_row_twice, "rows-twice"),
    "nests exchanged": (nests_exchanged, "nests-exchanged"),
    "nests exchanged from the middle on": (nests_exchanged_late, "nests-exchanged"),
    "nest table mirrored": (nests_mirrored, "nests-mirrored"),
    "temperature in kelvin": (kelvin, "temperature-in-kelvin"),
    "temperature in Fahrenheit": (fahrenheit, "temperature-in-fahrenheit"),
    "temperature in tenths": (tenths, "temperature-in-tenths"),
    "three values of -127": (sensor_lost, "no-temperature"),
    "temperature stuck": (sensor_stuck, "temperature-stuck"),
    "payload in grams": (payload_in_grams, "payload-in-grams"),
    "gravity in g": (gravity_in_g, "gravity-unit"),
    "sigmas in um": (sigmas_in_um, "sigma-in-um"),
    "three sigmas in um": (three_sigmas_in_um, "sigma-unit-in-rows"),
    "tracker moved by 20 to 50 mm": (moved_far, "station-moved"),
    "tracker moved by 10 mm after 95 %": (moved_late, "station-moved"),
    "tracker moved by 0.2 to 1 mm": (moved_little, "station-moved"),
    "SMR 0.5 to 3 mm larger in one nest": (other_smr, "smr-size"),
    "one label for two poses": (label_shared, "pose-label-shared"),
}
"""What is done to a clean run, and the remark that says so."""
