"""A hexapod corrected by its geometry and by six stages in a row: what not knowing it costs.

python -m bench six_stage [--seeds N] [--poses N ...]

A hexapod with the errors that its drawing allows is told poses by a controller that knows the
drawing, and measured in three nests with 5 um of noise an axis. The same readings are fitted with
the geometry of its legs, and with six stages (examples/six_stage), which know the poses alone.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from calib.arrays import Array
from calib.effects import Effect, effect_named
from calib.formulas.effect_file import effect_from_text
from calib.identify import hold_out
from calib.identify.staged import fit_effects
from calib.mechanism.description import Machine
from calib.mechanism.solve import forward, inverse
from calib.model.prototype import nests_of, prototype_run
from calib.poses.reach import sample_poses
from calib.runs import Run
from calib.runs.stack import stack

SIGMA_MM = 0.005
TERMS = Path(__file__).parents[1] / "examples" / "six_stage"


def as_stages(run: Run, hexapod: Machine, stages: Machine) -> Run:
    """The same readings; q as the stages have it at the poses that the controller was told."""
    told = forward(hexapod, hexapod.extension(run.q)).poses
    q = stages.coordinates(inverse(stages, told).extension)
    return replace(run, q=q, header=replace(run.header, machine=stages.name))


def own_terms() -> list[Effect]:
    """Products of one and of two commands, for every stage."""
    return [
        effect_from_text(path.read_text(encoding="utf-8"), path.name)
        for path in sorted(TERMS.glob("cross_*.toml"))
    ]


def held_out_um(run: Run, machine: Machine, effects: Sequence[Effect]) -> tuple[float, float, int]:
    """Held-out RMS, what a perfect model would have (floor), um, and the number of unknowns."""
    found = fit_effects(stack(machine, [run]), effects)
    held = hold_out(found)
    return 1e3 * held.rms_mm, 1e3 * held.floor_mm, found.model.prior.size


def uncorrected_um(hexapod: Machine, extension: Array, true: Array) -> float:
    """RMS of the nests from where the drawing has them, um."""
    real, drawn = forward(hexapod, extension, true).poses, forward(hexapod, extension).poses
    off = [
        real.points(p[:, None]) - drawn.points(p[:, None]) for p in nests_of(hexapod)[0].values()
    ]
    return 1e3 * float(np.sqrt(np.mean(np.sum(np.array(off) ** 2, axis=1))))


def rows_of(seed: int, count: int) -> Iterator[tuple[str, float, float, int]]:
    """What is fitted, held-out RMS, its floor (um), unknowns."""
    hexapod, stages = load_machine("hexapod"), load_machine("six-stage")
    draw = np.random.default_rng([seed, 1])
    true = hexapod.nominal + hexapod.tolerance * draw.uniform(-1, 1, hexapod.nominal.size)
    poses = sample_poses(hexapod, count, draw)
    room = np.random.default_rng([seed, 2])
    run = prototype_run(hexapod, "hexapod", poses, true, SIGMA_MM, room).run
    yield "nothing", uncorrected_um(hexapod, hexapod.extension(poses.q), true), 0.0, 0
    yield "geometry of the legs", *held_out_um(run, hexapod, [])
    staged, pitch = as_stages(run, hexapod, stages), effect_named("screw-pitch", stages)
    yield "six stages", *held_out_um(staged, stages, [])
    yield "six stages, screw-pitch", *held_out_um(staged, stages, [pitch])
    yield "and products of commands", *held_out_um(staged, stages, [pitch, *own_terms()])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--poses", type=int, nargs="+", default=[40, 80, 160])
    options = parser.parse_args()
    for count in options.poses:
        each = [list(rows_of(seed, count)) for seed in range(1, options.seeds + 1)]
        print(f"{count} poses, median of {options.seeds} hexapods (least, largest)")
        print(f"{'corrected':26s} {'unknowns':>8s} {'held-out RMS um':>24s} {'floor um':>16s}")
        for row in zip(*each, strict=True):
            rms, floor = np.array([r[1] for r in row]), np.median([r[2] for r in row])
            spread = f"{np.median(rms):.1f} ({rms.min():.1f}, {rms.max():.1f})"
            alone = f"{floor:.1f}" if floor else ""
            print(f"{row[0][0]:26s} {row[0][3]:8d} {spread:>24s} {alone:>16s}")
        print()


if __name__ == "__main__":
    main()
