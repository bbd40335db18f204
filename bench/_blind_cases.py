"""Cases of the blind trial: what is hidden, how large, and how it is measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocks.physics.hidden import Hidden
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

SIGMA_MM = 0.005
LEGS = {
    "hexapod": tuple(f"leg{k}" for k in range(1, 7)),
    "tripod": tuple(f"limb{k}" for k in range(1, 4)),
    "ptm": ("limb1", "limb2"),
}
NESTS = {
    "hexapod": ("3", "4", "5"),
    "tripod": ("p1", "p2", "p3"),
    "ptm": ("p1", "p2", "p3"),
}
POSE_SETS = ("designed 29", "random 29", "random 60", "random 100")
PROFILE = Profile(rise_K=6.0, payload_kg=(0.0, 12.0, 0.0, 12.0, 0.0, 12.0))

Table = dict[str, float]
Draw = Callable[[str, np.random.Generator], Table]


@dataclass(frozen=True)
class Case:
    """One blind run: the true effects by identifier, and their sizes in sqrt(3) sigma RMS."""

    seed: int
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    poses: str
    unknown: bool = False
    machine: str = "hexapod"

    @property
    def kind(self) -> str:
        """none, single, several or unknown."""
        if self.unknown:
            return "unknown"
        return ("none", "single", "several")[min(len(self.effects), 2)]


def _legs(stem: str, machine: str, rng: np.random.Generator) -> Table:
    """One leg, or all of them, with equal probability."""
    legs = LEGS[machine]
    chosen = legs if rng.random() < 0.5 else (legs[rng.integers(len(legs))],)
    return {f"{stem}.{leg}": float(rng.standard_normal()) for leg in chosen}


def _of_legs(stem: str) -> Draw:
    return lambda machine, rng: _legs(stem, machine, rng)


def _backlash(machine: str, rng: np.random.Generator) -> Table:
    return {name: abs(value) for name, value in _legs("backlash", machine, rng).items()}


def _cyclic(machine: str, rng: np.random.Generator) -> Table:
    low, high = (0.1, 6.28) if machine == "ptm" else (1.5, 12.0)  # rad, mm
    table = {"screw-cyclic.period": float(np.exp(rng.uniform(np.log(low), np.log(high))))}
    for name, value in _legs("screw-cyclic", machine, rng).items():
        phase = rng.uniform(0.0, 2.0 * np.pi)
        table[f"{name}.sin"] = float(value * np.cos(phase))
        table[f"{name}.cos"] = float(value * np.sin(phase))
    return table


def _direction(names: Sequence[str], rng: np.random.Generator) -> Table:
    return dict(zip(names, map(float, rng.standard_normal(len(names))), strict=True))


def _drift(machine: str, rng: np.random.Generator) -> Table:
    table = _direction([f"tracker-drift.v{axis}" for axis in "xyz"], rng)
    table.update({f"tracker-drift.w{axis}": float(7e-4 * rng.standard_normal()) for axis in "xyz"})
    return table


def _nest(machine: str, rng: np.random.Generator) -> Table:
    nest = NESTS[machine][rng.integers(3)]
    return _direction([f"nest-offset.{nest}.{axis}" for axis in "xyz"], rng)


def _tilt(machine: str, rng: np.random.Generator) -> Table:
    legs = LEGS[machine]
    names = [
        f"joint-tilt.{leg}.{b}.{a}" for leg in legs for b in ("base", "platform") for a in "yz"
    ]
    return _direction(names, rng)


def _shift(machine: str, rng: np.random.Generator) -> Table:
    table = _direction([f"frame-shift.{axis}" for axis in "xyz"], rng)
    table["frame-shift.where"] = float(rng.integers(2))
    table["frame-shift.t0"] = float(rng.uniform(0.2, 0.8))
    return table


def _settling(machine: str, rng: np.random.Generator) -> Table:
    return {"settling.k": float(rng.choice([-1.0, 1.0])), "settling.tau": float(rng.uniform(1, 4))}


def _redundancy(machine: str, rng: np.random.Generator) -> Table:
    return {"redundancy.limb": float(rng.integers(1, 5)), "redundancy.share": 1.0}


def _one(name: str) -> Draw:
    return lambda machine, rng: {name: float(rng.choice([-1.0, 1.0]))}


def _positive(name: str) -> Draw:
    return lambda machine, rng: {name: 1.0}


def _tide(machine: str, rng: np.random.Generator) -> Table:
    period = float(rng.uniform(400, 1500))
    return {"unknown.tide.amplitude": 1.0, "unknown.tide.period": period}


def _wobble(machine: str, rng: np.random.Generator) -> Table:
    return {"unknown.wobble.amplitude": 1.0, "unknown.wobble.period": float(rng.uniform(5, 20))}


EFFECTS: dict[str, Draw] = {
    "backlash": _backlash,
    "frame-shift": _shift,
    "gravity-sag": _positive("gravity-sag.c"),
    "joint-azimuth": _of_legs("joint-azimuth"),
    "joint-tilt": _tilt,
    "nest-offset": _nest,
    "parallelogram-sides": _of_legs("parallelogram-sides"),
    "redundancy": _redundancy,
    "screw-cyclic": _cyclic,
    "screw-pitch": _of_legs("screw-pitch"),
    "screw-twist": _one("screw-twist.L"),
    "settling": _settling,
    "thermal-growth": _positive("thermal-growth.a"),
    "tracker-drift": _drift,
    "tracker-offset": _one("tracker-offset.r0"),
    "tracker-scale": _one("tracker-scale.k"),
}
UNKNOWN: dict[str, Draw] = {
    "unknown.screw-quadratic": _of_legs("unknown.screw-quadratic"),
    "unknown.hysteresis": _of_legs("unknown.hysteresis"),
    "unknown.bending": _one("unknown.bending.k"),
    "unknown.soft-legs": _one("unknown.soft-legs.k"),
    "unknown.platform-flex": _one("unknown.platform-flex.k"),
    "unknown.tide": _tide,
    "unknown.wobble": _wobble,
}
ABSENT = {
    "hexapod": {"joint-azimuth", "parallelogram-sides", "redundancy"},
    "ptm": {
        "joint-azimuth",
        "joint-tilt",
        "parallelogram-sides",
        "screw-twist",
        "unknown.bending",
        "unknown.soft-legs",
    },
    "tripod": {
        "joint-tilt",
        "redundancy",
        "screw-twist",
        "unknown.bending",
        "unknown.soft-legs",
        "unknown.platform-flex",  # its platform does not tilt
    },
}
FIXED = ("period", "tau", "t0", "where", "limb")
"""Numbers that are no amplitudes: they keep their values when a case is scaled."""
TRIAL_MM = 0.01
TRIAL = {
    "gravity-sag": 1e-4, "thermal-growth": 1e-5, "screw-pitch": 1e-3, "screw-twist": 1.0,
    "settling": 1e-3, "joint-azimuth": 1e-4, "tracker-scale": 1e-5, "joint-tilt": 2e-3,
    "unknown.screw-quadratic": 1e-5, "unknown.bending": 1e-3, "unknown.soft-legs": 1e-6,
    "unknown.platform-flex": 1e-2, "redundancy": 0.1,
}  # fmt: skip
"""Amplitude of a first trial in the effect's own unit, before it is scaled to a size."""
TRIAL_ROTARY = {
    "backlash": 1e-5, "screw-cyclic": 1e-5, "screw-pitch": 1e-5, "settling": 1e-5,
    "gravity-sag": 1e-9, "unknown.screw-quadratic": 1e-5, "unknown.hysteresis": 1e-5,
}  # fmt: skip
"""The same where actuators turn: rad, rad/rad, rad/(N mm), 1/rad."""


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
    return simulate(replace(plan, hidden=Hidden(hidden))), hidden


def _scaled(
    plan: RunPlan, empty: SimulatedRun, name: str, size: float, rng: np.random.Generator
) -> Table:
    """Amplitudes such that the effect displaces the readings by ``size`` sqrt(3) sigma RMS."""
    table = (EFFECTS | UNKNOWN)[name](plan.machine, rng)
    span = float(empty.layout.time[-1])
    if "frame-shift.t0" in table:
        table["frame-shift.t0"] *= span
    own = TRIAL_ROTARY if plan.machine == "ptm" else {}
    trial = own.get(name, TRIAL.get(name, TRIAL_MM))
    amplitude = [key for key in table if key.rpartition(".")[2] not in FIXED]
    table |= {key: table[key] * trial for key in amplitude}
    bent = 0.5 if name == "redundancy" else 1.0  # a limb that softens is not linear in its share
    for _ in range(16 if name == "redundancy" else 3):
        seen = simulate(replace(plan, hidden=Hidden(table)))
        moved = (seen.xyz - empty.xyz)[empty.layout.reading]
        rms = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
        factor = size * np.sqrt(3.0) * SIGMA_MM / rms
        table |= {key: table[key] * factor**bent for key in amplitude}
        if "redundancy.share" in table:
            table["redundancy.share"] = min(table["redundancy.share"], 1.0)
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

    A step of the frame happened in the first run and is not in this one; everything else is.
    """
    left = {name: value for name, value in hidden.items() if not name.startswith("frame-shift")}
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


def draw_cases(count: int, seed: int, machine: str) -> list[Case]:
    """Equal shares over the catalogue at several sizes, pairs, triples, and unknown ones.

    Every effect comes as often as any other; the set of poses is drawn for each case, the
    designed ones for more than half of the single effects of size 1.
    """
    rng = np.random.default_rng([seed, len(machine)])
    absent = ABSENT[machine]
    names, unknown = sorted(EFFECTS.keys() - absent), sorted(UNKNOWN.keys() - absent)
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
