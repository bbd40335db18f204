"""Is the covariance of a fit honest about where commands lead? The truth of many machines by it.

    python -m bench hosted_truth [first [last]]

Machines with the hidden effects of ``hosted`` are measured in two runs, as ``hosted_wire`` does it,
fitted, and sent to 40 fresh poses under its four conditions. No tracker looks: where the platform
truly stands comes from the mock's physics without noise, so that nothing is compared but the fit
and its covariance. One machine says little, as its errors are few and common to all poses.
"""

import os
import sys
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from bench._hosted_judge import moved_by_parameters
from bench.hosted import CONDITIONS, EFFECTS, FROM_LIMITS_MM, plan_of, simulated_truth
from calib.arrays import Array
from calib.command import Identified, Surroundings, commands_for
from calib.effects import effect_named
from calib.identify import Fit
from calib.identify.staged import fit_effects
from calib.mechanism.rigid import Poses, pose_difference
from calib.poses import sample_poses
from calib.runs.stack import stack
from mocks.physics.bodies import body_named
from mocks.physics.truth import machine_file
from mocks.simulate.files import as_run
from mocks.simulate.machine import true_poses
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

CAMPAIGN = ((0.0, 20.5), (5.0, 26.0))
MEASURED, FRESH, TRIALS = 32, 40, 400
MACHINE = machine_file("hexapod")


@dataclass(frozen=True)
class Prototype:
    """A machine of a seed: its plan, its true parameters."""

    seed: int

    @property
    def plan(self) -> RunPlan:
        """The plan of ``hosted``."""
        return plan_of(self.seed)

    def fit(self) -> Fit:
        """Measure in two runs and identify."""
        truth, runs = simulated_truth(self.plan), []
        for number, (payload, temperature) in enumerate(CAMPAIGN):
            profile = Profile(start_C=temperature, rise_K=0.5, payload_kg=(payload,))
            seed = self.seed + 500 * number + 7
            plan = replace(self.plan, seed=seed, poses=MEASURED, parameters=truth, profile=profile)
            runs.append(as_run(simulate(plan)))
        named = [effect_named(name, MACHINE) for name in EFFECTS]
        return fit_effects(stack(MACHINE, runs), named)

    def stands(self, extension: Array, payload: float, temperature: float) -> Poses:
        """True poses at commanded extensions (6, N), visited one after the other from home."""
        body, count = body_named("hexapod"), extension.shape[1] + 1
        channels = {
            "structure_temp_C": np.full(count, temperature),
            "air_temp_C": np.full(count, 20.0),
            "payload_kg": np.full(count, payload),
            "delay_s": np.full(count, 5.0),
        }
        found = true_poses(
            body, simulated_truth(self.plan), self.plan, body.around.load,
            np.vstack([np.zeros(6), extension.T]), 30.0 * np.arange(count), channels,
        )  # fmt: skip
        return Poses(found.position[1:].T, np.moveaxis(found.rotation[1:], 0, -1))


def squares(prototype: Prototype) -> tuple[Array, Array]:
    """Mean squared error of place under each condition, um^2: in truth, and by the covariance."""
    fit = prototype.fit()
    values = dict(zip(fit.model.names, map(float, fit.values), strict=True))
    load = fit.model.rows.runs[0].header.load
    whole = Identified.from_values(MACHINE, values, fit.model.effects, load)
    fresh = sample_poses(MACHINE, 4 * FRESH, np.random.default_rng([prototype.seed, 5]))
    low, high = MACHINE.q_limits.T[:, :, None]
    inside = np.all((fresh.q > low + FROM_LIMITS_MM) & (fresh.q < high - FROM_LIMITS_MM), axis=0)
    wanted = fresh.task[:, np.flatnonzero(inside)[:FRESH]]
    true, told = [], []
    for payload, temperature in CONDITIONS:
        here = Surroundings({"payload_kg": payload, "structure_temp_C": temperature})
        commands = commands_for(whole, wanted, here)
        assert commands.solved.all(), [why for why in commands.refused if why]
        stood = prototype.stands(commands.extension, payload, temperature)
        off = pose_difference(Poses.from_xyz_rpy(wanted), stood)[:3]
        rng = np.random.default_rng(prototype.seed)
        moved = moved_by_parameters(whole, fit, commands.q, here, rng, TRIALS)
        true.append(1e6 * float(np.mean(np.sum(off**2, axis=0))))
        told.append(1e6 * float(np.mean(np.sum(moved**2, axis=0))))
    return np.array(true), np.array(told)


def main() -> None:
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    last = int(sys.argv[2]) if len(sys.argv) > 2 else first + 9
    found = []
    for seed in range(first, last + 1):
        true, told = squares(Prototype(seed))
        found.append((true, told))
        print(f"{seed:4d} in truth {np.sqrt(true).round(2)} by the covariance "
              f"{np.sqrt(told).round(2)} um, ratio {np.sqrt(true.sum() / told.sum()):.3f}",
              flush=True)  # fmt: skip
    every = np.array(found)
    each = np.sqrt(every[:, 0].mean(axis=0) / every[:, 1].mean(axis=0))
    ratio = every[:, 0].sum(axis=1) / every[:, 1].sum(axis=1)
    spread = float(ratio.std(ddof=1)) if len(ratio) > 1 else float("nan")
    print(f"\n{len(ratio)} machines, RMS in truth by the covariance: {each.round(3)} under the "
          f"four conditions, {np.sqrt(ratio.mean()):.3f} +- "
          f"{spread / np.sqrt(len(ratio)) / (2.0 * np.sqrt(ratio.mean())):.3f} over all; "
          f"its square scatters by {spread:.2f} from machine to machine")  # fmt: skip


if __name__ == "__main__":
    main()
