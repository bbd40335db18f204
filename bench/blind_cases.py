"""Cases of the blind trial: what is hidden, how large, and how it is measured."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mocks.physics.hidden import Hidden
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

SIGMA_MM = 0.005
LEGS = tuple(f"leg{k}" for k in range(1, 7))
PROFILE = Profile(rise_K=6.0, payload_kg=(0.0, 12.0, 0.0, 12.0, 0.0, 12.0))

Table = dict[str, float]
Draw = Callable[[np.random.Generator], Table]


@dataclass(frozen=True)
class Case:
    """One blind run: the true effects by identifier, and their sizes in sqrt(3) sigma RMS."""

    seed: int
    effects: tuple[str, ...]
    sizes: tuple[float, ...]
    poses: str
    unknown: bool = False

    @property
    def kind(self) -> str:
        """none, single, several or unknown."""
        if self.unknown:
            return "unknown"
        return ("none", "single", "several")[min(len(self.effects), 2)]


def _legs(stem: str, rng: np.random.Generator) -> Table:
    """One leg, or all of them, with equal probability."""
    chosen = LEGS if rng.random() < 0.5 else (LEGS[rng.integers(6)],)
    return {f"{stem}.{leg}": float(rng.standard_normal()) for leg in chosen}


def _backlash(rng: np.random.Generator) -> Table:
    return {name: abs(value) for name, value in _legs("backlash", rng).items()}


def _cyclic(rng: np.random.Generator) -> Table:
    table = {"screw-cyclic.period": float(np.exp(rng.uniform(np.log(1.5), np.log(12.0))))}
    for name, value in _legs("screw-cyclic", rng).items():
        phase = rng.uniform(0.0, 2.0 * np.pi)
        table[f"{name}.sin"] = float(value * np.cos(phase))
        table[f"{name}.cos"] = float(value * np.sin(phase))
    return table


def _direction(names: Sequence[str], rng: np.random.Generator) -> Table:
    return dict(zip(names, map(float, rng.standard_normal(len(names))), strict=True))


def _drift(rng: np.random.Generator) -> Table:
    table = _direction([f"tracker-drift.v{axis}" for axis in "xyz"], rng)
    table.update({f"tracker-drift.w{axis}": float(7e-4 * rng.standard_normal()) for axis in "xyz"})
    return table


def _nest(rng: np.random.Generator) -> Table:
    nest = ("3", "4", "5")[rng.integers(3)]
    return _direction([f"nest-offset.{nest}.{axis}" for axis in "xyz"], rng)


def _tilt(rng: np.random.Generator) -> Table:
    names = [
        f"joint-tilt.{leg}.{body}.{axis}"
        for leg in LEGS
        for body in ("base", "platform")
        for axis in "yz"
    ]
    return _direction(names, rng)


def _shift(rng: np.random.Generator) -> Table:
    table = _direction([f"frame-shift.{axis}" for axis in "xyz"], rng)
    table["frame-shift.where"] = float(rng.integers(2))
    table["frame-shift.t0"] = float(rng.uniform(0.2, 0.8))
    return table


def _settling(rng: np.random.Generator) -> Table:
    return {"settling.k": float(rng.choice([-1.0, 1.0])), "settling.tau": float(rng.uniform(1, 4))}


def _one(name: str) -> Draw:
    return lambda rng: {name: float(rng.choice([-1.0, 1.0]))}


EFFECTS: dict[str, Draw] = {
    "backlash": _backlash,
    "frame-shift": _shift,
    "gravity-sag": lambda rng: {"gravity-sag.c": 1.0},
    "joint-tilt": _tilt,
    "nest-offset": _nest,
    "screw-cyclic": _cyclic,
    "screw-pitch": lambda rng: _legs("screw-pitch", rng),
    "screw-twist": _one("screw-twist.L"),
    "settling": _settling,
    "thermal-growth": lambda rng: {"thermal-growth.a": 1.0},
    "tracker-drift": _drift,
    "tracker-offset": _one("tracker-offset.r0"),
    "tracker-scale": _one("tracker-scale.k"),
}
UNKNOWN: dict[str, Draw] = {
    "unknown.screw-quadratic": lambda rng: _legs("unknown.screw-quadratic", rng),
    "unknown.hysteresis": lambda rng: _legs("unknown.hysteresis", rng),
    "unknown.bending": _one("unknown.bending.k"),
    "unknown.soft-legs": _one("unknown.soft-legs.k"),
    "unknown.platform-flex": _one("unknown.platform-flex.k"),
    "unknown.tide": lambda rng: {
        "unknown.tide.amplitude": 1.0,
        "unknown.tide.period": float(rng.uniform(400, 1500)),
    },
    "unknown.wobble": lambda rng: {
        "unknown.wobble.amplitude": 1.0,
        "unknown.wobble.period": float(rng.uniform(5, 20)),
    },
}
FIXED = ("period", "tau", "t0", "where")
"""Numbers that are no amplitudes: they keep their values when a case is scaled."""
TRIAL_MM = 0.01
TRIAL = {
    "gravity-sag": 1e-4, "thermal-growth": 1e-5, "screw-pitch": 1e-3, "screw-twist": 1.0,
    "settling": 1e-3, "tracker-scale": 1e-5, "joint-tilt": 2e-3, "unknown.screw-quadratic": 1e-5,
    "unknown.bending": 1e-3, "unknown.soft-legs": 1e-6, "unknown.platform-flex": 1e-2,
}  # fmt: skip
"""Amplitude of a first trial in the effect's own unit, before it is scaled to a size."""


def build(case: Case, poses: object) -> tuple[SimulatedRun, Table]:
    """Simulate a case; the run, and the hidden table after scaling."""
    rng = np.random.default_rng([case.seed, 7])
    plan = RunPlan(
        seed=case.seed,
        poses=poses,  # type: ignore[arg-type]
        noise_mm=SIGMA_MM,
        profile=PROFILE,
        prior="normal",
    )
    empty = simulate(plan)
    hidden: Table = {}
    for name, size in zip(case.effects, case.sizes, strict=True):
        hidden |= _scaled(plan, empty, name, size, rng)
    return simulate(replace(plan, hidden=Hidden(hidden))), hidden


def _scaled(
    plan: RunPlan, empty: SimulatedRun, name: str, size: float, rng: np.random.Generator
) -> Table:
    """Amplitudes such that the effect displaces the readings by ``size`` sqrt(3) sigma RMS."""
    table = (EFFECTS | UNKNOWN)[name](rng)
    span = float(empty.layout.time[-1])
    if "frame-shift.t0" in table:
        table["frame-shift.t0"] *= span
    trial = TRIAL.get(name, TRIAL_MM)
    amplitude = [key for key in table if key.rpartition(".")[2] not in FIXED]
    table |= {key: table[key] * trial for key in amplitude}
    for _ in range(3):
        seen = simulate(replace(plan, hidden=Hidden(table)))
        moved = (seen.xyz - empty.xyz)[empty.layout.reading]
        rms = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
        factor = size * np.sqrt(3.0) * SIGMA_MM / rms
        table |= {key: table[key] * factor for key in amplitude}
        if abs(factor - 1.0) < 0.02:
            break
    return table


def displaced(case: Case, poses: object, hidden: Table) -> np.ndarray:
    """Displacement (3, readings) in mm that a hidden table causes, without noise."""
    plan = RunPlan(
        seed=case.seed,
        poses=poses,  # type: ignore[arg-type]
        noise_mm=SIGMA_MM,
        profile=PROFILE,
        prior="normal",
    )
    with_it, without = simulate(replace(plan, hidden=Hidden(hidden))), simulate(plan)
    moved = (with_it.xyz - without.xyz)[without.layout.reading]
    return np.asarray(moved.T)


def draw_cases(count: int, seed: int, pose_sets: Sequence[str]) -> list[Case]:
    """Equal shares over the catalogue at several sizes, pairs, triples, none and unknown ones."""
    rng = np.random.default_rng(seed)
    names, unknown = sorted(EFFECTS), sorted(UNKNOWN)
    cases = []
    for number in range(count):
        poses = pose_sets[number % len(pose_sets)]
        kind = number % 10
        at = 1000 * seed + number
        if kind < 5:
            effect = names[(number // 10 * 5 + kind) % len(names)]
            size = (1.0, 1.0, 2.0, 0.5, 4.0)[kind]
            cases.append(Case(at, (effect,), (size,), poses))
        elif kind < 7:
            two = tuple(rng.choice(names, 2, replace=False))
            cases.append(Case(at, two, (2.0, 2.0), poses))
        elif kind == 7:
            three = tuple(rng.choice(names, 3, replace=False))
            cases.append(Case(at, three, (2.0, 2.0, 2.0), poses))
        elif kind == 8:
            cases.append(Case(at, (), (), poses))
        else:
            effect = unknown[number // 10 % len(unknown)]
            cases.append(Case(at, (effect,), (2.0,), poses, unknown=True))
    return cases
