"""What is left when the host computes the motion, and when a controller does: error of the machine.

    python -m bench hosted [seeds]

A mock hexapod hides gravity sag, growth with temperature, a cyclic error of every screw and lost
motion in every leg. It is measured warming up with two payloads, the four effects are named and
fitted, and it is sent to fresh poses at two payloads and two temperatures 5 K apart: by a host
with all that was found in the command; by a controller that holds geometry, lost motion and
cyclic errors, as node 10 does; and with geometry alone. Errors are of the platform's place, as a
tracker sees it, beside what the readings' noise and the covariance of the fit say.
"""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import dataclass, replace

import numpy as np

from bench._hosted_judge import LIMIT, Judged, judge
from calib.arrays import Array
from calib.command import Identified, Surroundings, commands_for, pose_commands
from calib.effects import effect_named
from calib.identify import Fit
from calib.identify.staged import fit_effects
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.poses import sample_poses
from calib.runs.stack import stack
from mocks.hidden.table import Hidden
from mocks.physics.truth import machine_file
from mocks.simulate.files import as_run
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

EFFECTS = ("gravity-sag", "backlash", "thermal-growth", "screw-cyclic")
NODE_10 = ("backlash", "screw-cyclic")
WAYS = (("host", EFFECTS), ("node 10", NODE_10), ("geometry", ()))
CONDITIONS = ((0.0, 20.5), (0.0, 25.5), (5.0, 20.5), (5.0, 25.5))
MEASURED, FRESH = 60, 48
RISE_K = 6.0
FROM_LIMITS_MM = 1.5
"""Kept from the strokes by fresh poses: the corrected command must fit in too."""


@dataclass(frozen=True)
class Row:
    """One verification of one machine."""

    seed: int
    way: str
    payload_kg: float
    temperature_C: float
    found: Judged


def hidden_of(seed: int) -> dict[str, float]:
    """What the machine of a seed hides."""
    rng = np.random.default_rng([seed, 9])
    table = {
        "gravity-sag.c": rng.uniform(2e-4, 5e-4),
        "thermal-growth.a": rng.uniform(0.8e-5, 1.2e-5),
        "screw-cyclic.period": 5.0,
    }
    for leg in range(1, 7):
        phase, size = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.005, 0.012)
        table[f"backlash.leg{leg}"] = rng.uniform(0.01, 0.03)
        table[f"screw-cyclic.leg{leg}.sin"] = size * np.cos(phase)
        table[f"screw-cyclic.leg{leg}.cos"] = size * np.sin(phase)
    return table


def plan_of(seed: int) -> RunPlan:
    """The campaign in which the machine is measured."""
    return RunPlan(
        seed=seed,
        poses=MEASURED,
        order="pose-by-pose",
        noise_mm=None,
        hidden=Hidden(hidden_of(seed)),
        profile=Profile(rise_K=RISE_K, payload_kg=(0.0, 5.0, 0.0, 5.0)),
    )


def verified(
    plan: RunPlan, machine: Machine, fit: Fit, effects: tuple[str, ...], wanted: Array,
    payload: float, temperature: float,
) -> Judged:  # fmt: skip
    """Send the machine to wanted poses (6, N), all of them commanded with these effects."""
    values = dict(zip(fit.model.names, map(float, fit.values), strict=True))
    load = fit.model.rows.runs[0].header.load
    named = [effect_named(name, machine) for name in effects]
    own = {k: v for k, v in values.items() if k.partition(".")[0] in effects or "frame" in k}
    own |= {k: v for k, v in values.items() if k in machine.parameter_index}
    computes = Identified.from_values(machine, own, named, load)
    here = Surroundings({"payload_kg": payload, "structure_temp_C": temperature})
    commands = commands_for(computes, wanted, here)
    assert commands.solved.all(), [why for why in commands.refused if why]
    told = pose_commands(computes, commands).to_xyz_rpy().T
    seen = simulate(
        replace(
            plan,
            seed=plan.seed + 1000 * (1 + CONDITIONS.index((payload, temperature))),
            parameters=simulated_truth(plan),
            poses=told,
            profile=Profile(start_C=temperature, rise_K=0.0, payload_kg=(payload,)),
        )
    )
    whole = Identified.from_values(machine, values, fit.model.effects, load)
    return judge(
        as_run(seen), Poses.from_xyz_rpy(wanted), whole, fit, commands.q, here,
        np.random.default_rng(plan.seed),
    )  # fmt: skip


def simulated_truth(plan: RunPlan) -> dict[str, float]:
    """True parameters of the machine of a campaign."""
    return dict(simulate(replace(plan, poses=2, hidden=Hidden({}))).parameters)


def rows_of(seed: int) -> list[Row]:
    """Measure, identify and verify one machine."""
    plan, machine = plan_of(seed), machine_file("hexapod")
    run = as_run(simulate(plan))
    fit = fit_effects(stack(machine, [run]), [effect_named(name, machine) for name in EFFECTS])
    fresh = sample_poses(machine, 4 * FRESH, np.random.default_rng([seed, 5]))
    low, high = machine.q_limits.T[:, :, None]
    inside = np.all((fresh.q > low + FROM_LIMITS_MM) & (fresh.q < high - FROM_LIMITS_MM), axis=0)
    wanted = fresh.task[:, np.flatnonzero(inside)[:FRESH]]
    assert wanted.shape[1] >= 40
    return [
        Row(seed, way, payload, temperature,
            verified(plan, machine, fit, effects, wanted, payload, temperature))
        for payload, temperature in CONDITIONS
        for way, effects in WAYS
    ]  # fmt: skip


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    print(f"{'seed':>4s} {'kg':>4s} {'deg C':>6s}" + "".join(f"{w:>12s}" for w, _ in WAYS)
          + f"{'expected':>10s}{'ratio':>7s}{'peak':>8s}{'99 %':>8s}   RMS, um")  # fmt: skip
    rows: list[Row] = []
    for seed in range(1, seeds + 1):
        mine = rows_of(seed)
        rows += mine
        for payload, temperature in CONDITIONS:
            here = [r for r in mine if (r.payload_kg, r.temperature_C) == (payload, temperature)]
            host = here[0].found
            cells = "".join(f"{row.found.rms:12.2f}" for row in here)
            print(f"{seed:4d} {payload:4.0f} {temperature:6.1f}{cells}{host.expected_rms:10.2f}"
                  f"{host.ratio:7.3f}{host.peak:8.2f}{host.peak_99:8.2f}", flush=True)  # fmt: skip
    _summary(rows)


def _summary(rows: list[Row]) -> None:
    """One line a way and condition, over all machines."""
    print("\nover all machines: RMS, expected, RMS by expected; peak, um")
    for payload, temperature in CONDITIONS:
        for way, _ in WAYS:
            own = [
                r.found for r in rows
                if (r.way, r.payload_kg, r.temperature_C) == (way, payload, temperature)
            ]  # fmt: skip
            rms = float(np.sqrt(np.mean([f.rms**2 for f in own])))
            expected = float(np.sqrt(np.mean([f.expected_rms**2 for f in own])))
            print(
                f"{payload:4.0f} kg {temperature:5.1f} C  {way:9s} {rms:8.2f} {expected:8.2f} "
                f"{rms / expected:7.2f} {max(f.peak for f in own):9.2f}"
            )
    host = [r.found for r in rows if r.way == "host"]
    good = sum(f.ratio <= LIMIT for f in host)
    below = sum(f.peak <= f.peak_99 for f in host)
    likely = sum(f.likely for f in host)
    print(
        f"host: RMS within {LIMIT} of what is expected in {good} of {len(host)} verifications "
        f"({likely:.0f} by the covariances), peak below its 99 % quantile in {below}"
    )


if __name__ == "__main__":
    main()
