"""Cases of the blind trial: what is hidden, how large, and how it is measured."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bench._blind_noise import noisy, widened
from mocks.hidden import effects, effects_of
from mocks.hidden.effect import Site, Table
from mocks.hidden.table import Hidden
from mocks.physics.bodies import body_named
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

SIGMA_MM = 0.005
NEXT_TO_NONE_MM = 1e-9
POSE_SETS = ("designed 29", "random 29", "random 60", "random 100")
PROFILE = Profile(rise_K=6.0, payload_kg=(0.0, 12.0, 0.0, 12.0, 0.0, 12.0))


@dataclass(frozen=True)
class Case:
    """One blind run: the true effects by identifier, and their sizes in sqrt(3) sigma RMS."""

    seed: int
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    poses: str
    unknown: bool = False
    machine: str = "hexapod"
    noise: str = ""
    """Condition of the noise (``_blind_noise.py``); empty: white, as stated."""

    @property
    def kind(self) -> str:
        """none, single, several or unknown."""
        if self.unknown:
            return "unknown"
        return ("none", "single", "several")[min(len(self.effects), 2)]


@cache
def site_of(machine: str) -> Site:
    """Where effects are hidden on a mock machine."""
    body = body_named(machine)
    return Site(machine, body.limbs, tuple(body.around.platform_nests), body.stroke)


def drawn_on(machine: str, *, unknown: bool) -> list[str]:
    """Effects of the catalogue, or those outside it, that can be hidden on a mock machine."""
    return [
        effect.id
        for effect in effects_of(machine)
        if machine not in effect.unseen and effect.id.startswith("unknown.") == unknown
    ]


def _plan(case: Case, poses: object) -> RunPlan:
    return RunPlan(
        machine=case.machine,
        seed=case.seed,
        poses=poses,  # type: ignore[arg-type]
        noise_mm=SIGMA_MM,
        profile=PROFILE,
        prior="normal",
        delays=True,
    )


def build(case: Case, poses: object) -> tuple[SimulatedRun, Table]:
    """Simulate a case; the run, and the hidden table after scaling."""
    rng = np.random.default_rng([case.seed, 7])
    plan = _plan(case, poses)
    empty = simulate(plan)
    hidden: Table = {}
    for name, size in zip(case.effects, case.sizes, strict=True):
        hidden |= _scaled(plan, empty, name, size, rng)
    run = simulate(replace(plan, hidden=Hidden(hidden)))
    if case.noise.startswith("added:"):
        run = simulate(replace(plan, hidden=Hidden(hidden), noise_mm=None))
        run = replace(run, xyz=widened(run, case.noise, SIGMA_MM, case.seed))
    elif case.noise:
        quiet = simulate(replace(plan, hidden=Hidden(hidden), noise_mm=NEXT_TO_NONE_MM))
        run = replace(run, xyz=noisy(quiet, case.noise, SIGMA_MM, case.seed))
    return run, hidden


def _scaled(
    plan: RunPlan, empty: SimulatedRun, name: str, size: float, rng: np.random.Generator
) -> Table:
    """Amplitudes such that the effect displaces the readings by ``size`` sqrt(3) sigma RMS."""
    effect = next(effect for effect in effects() if effect.id == name)
    site = replace(site_of(plan.machine), span_s=float(empty.layout.time[-1]))
    table = effect.draw(site, rng)
    trial = effect.trial
    if site.rotary and effect.trial_rotary is not None:
        trial = effect.trial_rotary
    amplitude = [key for key in table if key.rpartition(".")[2] not in effect.steady]
    table |= {key: table[key] * trial for key in amplitude}
    bent = 1.0 if effect.linear else 0.5
    for _ in range(3 if effect.linear else 16):
        seen = simulate(replace(plan, hidden=Hidden(table)))
        moved = (seen.xyz - empty.xyz)[empty.layout.reading]
        rms = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
        factor = size * np.sqrt(3.0) * SIGMA_MM / rms
        most = 1.0 if not effect.linear else np.inf  # a share: what is wholly gone cannot go more
        table |= {key: min(table[key] * factor**bent, most) for key in amplitude}
        if abs(factor - 1.0) < 0.02:
            break
    return table


def displaced(case: Case, poses: object, hidden: Table) -> np.ndarray:
    """Displacement (3, readings) in mm that a hidden table causes, without noise."""
    plan = _plan(case, poses)
    with_it, without = simulate(replace(plan, hidden=Hidden(hidden))), simulate(plan)
    moved = (with_it.xyz - without.xyz)[without.layout.reading]
    return np.asarray(moved.T)


def build_follow_up(
    first: SimulatedRun, hidden: Table, poses: np.ndarray, conditions: Mapping[str, float]
) -> SimulatedRun:
    """Simulate a second run of the same machine on another day, in another frame.

    A step of the frame happened in the first run and is not in this one, nor is that of an actuator
    that was homed between; everything else is.
    """
    over = ("frame-shift.", "actuator-step.")
    left = {name: value for name, value in hidden.items() if not name.startswith(over)}
    channels = first.channels
    profile = Profile(
        start_C=conditions.get("structure_temp_C", float(channels["structure_temp_C"][-1])),
        rise_K=0.0,
        payload_kg=(conditions.get("payload_kg", float(channels["payload_kg"][-1])),),
    )
    plan = replace(
        first.plan,
        seed=first.plan.seed + 5_000_000,
        poses=poses,
        parameters=first.parameters,
        profile=profile,
        hidden=Hidden(left),
    )
    return simulate(plan)


def draw_cases(
    count: int, seed: int, machine: str, allowed: Collection[str] | None = None
) -> list[Case]:
    """Equal shares over the catalogue at several sizes, pairs, triples, and unknown ones.

    Every effect comes as often as any other; the set of poses is drawn for each case, the
    designed ones for more than half of the single effects of size 1. ``allowed`` limits the known
    effects that are hidden, not those that are looked for: a trial of a smaller catalogue again.
    """
    rng = np.random.default_rng([seed, len(machine)])
    names, unknown = drawn_on(machine, unknown=False), drawn_on(machine, unknown=True)
    if allowed is not None:
        names = [name for name in names if name in allowed]
    cases = []
    for number in range(count):
        kind, turn = number % 10, number // 10
        poses = str(rng.choice(POSE_SETS))
        at = 100_000 * seed + number
        if kind < 6:
            effect = names[(turn * 6 + kind) % len(names)]
            size = (1.0, 1.0, 1.0, 2.0, 0.5, 4.0)[(kind + turn * 6 // len(names)) % 6]
            if size == 1.0 and rng.random() < 0.5:
                poses = POSE_SETS[0]
            cases.append(Case(at, (effect,), (size,), poses, machine=machine))
        elif kind < 8:
            two = tuple(map(str, rng.choice(names, 2, replace=False)))
            cases.append(Case(at, two, (2.0, 2.0), poses, machine=machine))
        elif kind == 8:
            three = tuple(map(str, rng.choice(names, 3, replace=False)))
            cases.append(Case(at, three, (2.0, 2.0, 2.0), poses, machine=machine))
        else:
            effect = unknown[turn % len(unknown)]
            cases.append(Case(at, (effect,), (2.0,), poses, unknown=True, machine=machine))
    return cases


def draw_nulls(count: int, seed: int, machine: str) -> list[Case]:
    """Runs in which nothing is hidden, the four sets of poses in turn."""
    return [
        Case(100_000 * seed + 50_000 + k, (), (), POSE_SETS[k % 4], machine=machine)
        for k in range(count)
    ]
