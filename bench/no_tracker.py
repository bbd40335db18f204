"""A delta without a laser tracker: heights, calipers on a printed part, and a tracker beside them.

python -m bench no_tracker [--seeds N] [--plain]

Deltas with the errors that the drawing allows (towers lean, the two rods of a pair differ) are
probed at 30 places of the bed; 12 distances between marks at these places are measured with
calipers. The same numbers go to the least squares that 3D printers use (bench/_tower_delta.py) and
to runs of version 2. Judged at 300 fresh poses up to 120 mm above the bed, after the one shift and
turn in the plane of the bed that no reading can know. ``--plain``: the towers stand upright at one
radius and rods are equal, so that the printer's model is complete.
"""

import argparse
import re
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from app.files.machines import load_machine
from bench._tower_delta import Measured, calibrate, effector
from calib.arrays import Array, IntArray
from calib.identify import Fit, fit
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import exponential
from calib.mechanism.solve import forward, inverse
from calib.model import Model
from calib.poses.reach import PoseSet, sample_poses
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.kinds import Laboratory, Stand

HEIGHTS, DISTANCES, FRESH = 30, 12, 300
PROBE_MM, CALIPERS_MM, TRACKER_MM = 0.010, 0.020, 0.010
BED, REACH = 40.0, 60.0


@dataclass(frozen=True, eq=False)
class Judged:
    """RMS errors at fresh poses, um: in the plane and in height; and what the fit expected."""

    plane: float
    height: float
    plane_expected: float = float("nan")
    height_expected: float = float("nan")


def drawn(machine: Machine, rng: np.random.Generator, *, plain: bool) -> Array:
    """Parameters (P,) uniform within the tolerances; ``plain``: what a printer's model can say."""
    off = machine.tolerance * rng.uniform(-1.0, 1.0, machine.nominal.size)
    names = [parameter.name for parameter in machine.parameters]
    for k, name in enumerate(names) if plain else ():
        tower, _, what = name.partition(".")
        if what.startswith("lean") or (what, tower) == ("azimuth", "tower3"):
            off[k] = 0.0
        elif what == "length_b":
            off[k] = off[names.index(f"{tower}.length_a")]
        elif what == "radius":
            off[k] = off[names.index("tower1.radius")]
    return np.asarray(machine.nominal + off)


def upright() -> Machine:
    """The delta as a drawing with upright towers and rods that are equal in pairs has it."""
    text = files("calib.machines").joinpath("delta.toml").read_text(encoding="utf-8")
    text = text.replace(" ry:lean_in rx:lean_aside", "")
    text = text.replace("tz:-length_b", "tz:-length_a")
    text = re.sub(r"^(length_b|lean_in|lean_aside) = .*\n", "", text, flags=re.MULTILINE)
    text = text.replace('["length_a", "length_b"]', '["length_a"]')
    text = text.replace('parallelogram = ["length_a"]\n', "")
    return parse_machine(text, "delta")


def probed(machine: Machine) -> Array:
    """q (3, N) at which a nominal machine stands over the bed: a spiral of Vogel's sunflower."""
    k = np.arange(HEIGHTS)
    radius, angle = REACH * np.sqrt((k + 0.5) / HEIGHTS), k * np.pi * (3.0 - np.sqrt(5.0))
    task = np.array([radius * np.cos(angle), radius * np.sin(angle), np.full(HEIGHTS, BED)])
    return machine.coordinates(inverse(machine, task).extension)


def ends(q: Array) -> IntArray:
    """Places (2, M) between which is measured: far ones, in all directions of the bed."""
    outer = np.arange(HEIGHTS - DISTANCES, HEIGHTS)
    return np.array([outer, np.roll(outer, DISTANCES // 2 - 1)], dtype=np.intp)


def laboratory(machine: Machine, real: Array, q: Array, rng: np.random.Generator) -> Laboratory:
    """A machine with the parameters ``real`` (P,) that has stood at q (3, N) once each."""
    base = {f"b{k + 1}": 300.0 * np.array([np.cos(k), np.sin(k), -0.1]) for k in range(4)}
    frame = Stand(exponential(np.array([0.01, 0.02, 0.7])), np.array([2000.0, 500.0, -300.0]))
    nests = {
        "platform": {"tool": [0.0, 0.0, 0.0]},
        "base": {k: v.tolist() for k, v in base.items()},
    }
    instruments = {"probe": {"frame": "base"}, "calipers": {"frame": "base"}, "tracker": {}}
    header = {"machine": machine.name, "nests": nests, "instruments": instruments}
    return Laboratory(header, {"tool": np.zeros(3)}, base, 3, rng, {"tracker": frame})


def measured(machine: Machine, real: Array, q: Array, seed: int) -> tuple[Measured, dict[str, str]]:
    """Numbers for the printer's least squares; points.csv by what is read, and run.toml."""
    poses = forward(machine, machine.extension(q), real).poses
    pairs = ends(q)
    texts: dict[str, str] = {}
    for what in ("heights", "calipers", "tracker"):
        lab = laboratory(machine, real, q, np.random.default_rng(seed))
        for k in range(HEIGHTS):
            lab.go(f"{k}", q[:, k].tolist(), poses.position[:, k], poses.rotation[:, :, k])
            if what == "tracker":
                lab.point("tool", TRACKER_MM, by="tracker")
            else:
                lab.point("tool", PROBE_MM, by="probe", only="z")
        if what == "calipers":
            for first, second in pairs.T:
                lab.marks("tool", f"{first}", f"{second}", CALIPERS_MM, by="calipers")
        if what == "tracker":
            for nest in lab.base:
                lab.point(nest, TRACKER_MM, by="tracker")
        texts["header"], texts[what] = lab.texts()
    heights = np.array([row["z"] for row in lab_rows(texts["calipers"]) if row["z"]], dtype=float)
    apart = [row["value"] for row in lab_rows(texts["calipers"]) if row["value"]]
    return Measured(q, heights, np.array(apart, dtype=float), pairs), texts


def lab_rows(text: str) -> list[dict[str, str]]:
    """Rows of a points.csv as they stand."""
    head, *lines = [line.split(",") for line in text.splitlines()]
    return [dict(zip(head, line, strict=True)) for line in lines]


def in_plane(points: Array) -> Array:
    """Motions (3, 2N) of points (3, N) by a shift and a turn in the plane of the bed."""
    x, y, _ = points
    return np.array(
        [[np.ones_like(x), 0.0 * x], [0.0 * x, np.ones_like(x)], [-y, x]]
    ).reshape(3, -1)  # fmt: skip


def without(motions: Array, columns: Array) -> Array:
    """Columns (..., 2N) without what the motions (3, 2N) can do."""
    basis = np.linalg.qr(motions.T)[0]
    return np.asarray(columns - (columns @ basis) @ basis.T)


def judge(off: Array, points: Array) -> tuple[float, float]:
    """RMS um of errors (3, N) in the plane and in height."""
    plane = without(in_plane(points), off[:2].reshape(-1)).reshape(2, -1)
    return (
        1000.0 * float(np.sqrt(np.mean(np.sum(plane**2, axis=0)))),
        1000.0 * float(np.sqrt(np.mean(off[2] ** 2))),
    )


def judged(found: Fit, machine: Machine, fresh: PoseSet, true: Array) -> Judged:
    """Errors of a fit at fresh poses, and what its covariance says of them."""
    closed = forward(machine, machine.extension(fresh.q), found.linear.state.parameters)
    plane, height = judge(closed.poses.position - true, true)
    free = found.model.free
    moved = pose_jacobians(machine, closed, found.linear.state.parameters).parameters[free, :3]
    covariance = found.covariance[: free.size, : free.size]
    flat = without(in_plane(true), moved[:, :2].reshape(free.size, -1))
    expected = [float(np.sum(one * (covariance @ one))) for one in (flat, moved[:, 2])]
    return Judged(plane, height, *(1000.0 * np.sqrt(np.array(expected) / true.shape[1])))


def one(machine: Machine, seed: int, q: Array, fresh: PoseSet, *, plain: bool) -> dict[str, Judged]:
    """One machine, measured and judged in every way."""
    rng = np.random.default_rng(seed)
    real = drawn(machine, rng, plain=plain)
    true = forward(machine, machine.extension(fresh.q), real).poses.position
    numbers, texts = measured(machine, real, q, seed)
    found = {"before": Judged(*judge(fresh.poses.position - true, true))}
    alone = Measured(q, numbers.heights, np.zeros(0), np.zeros((2, 0), dtype=np.intp))
    for name, data in (("printer, heights", alone), ("printer, + calipers", numbers)):
        off = effector(calibrate(data), fresh.q) - true
        found[name] = Judged(*judge(off, true))
    for what, name in (
        ("heights", "heights"), ("calipers", "heights + calipers"), ("tracker", "tracker"),
    ):  # fmt: skip
        run = parse_run(texts["header"], texts[what], actuators=3)
        found[name] = judged(fit(Model(stack(machine, [run]))), machine, fresh, true)
    if plain:
        drawing = upright()
        run = parse_run(texts["header"], texts["calipers"], actuators=3)
        name = "the same, upright"
        found[name] = judged(fit(Model(stack(drawing, [run]))), drawing, fresh, true)
    return found


def main() -> None:
    """Print medians over the machines, and the paired differences to the printer's method."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--plain", action="store_true", help="upright towers, equal rods")
    asked = parser.parse_args()
    seeds = asked.seeds
    machine = load_machine("delta")
    q = probed(machine)
    fresh = sample_poses(machine, FRESH, np.random.default_rng(7))
    all_of = [one(machine, seed, q, fresh, plain=asked.plain) for seed in range(1, seeds + 1)]
    print(f"{seeds} deltas, {HEIGHTS} heights, {DISTANCES} distances; medians at fresh poses, um")
    print(f"{'':22}{'x, y':>8}{'z':>8}{'x, y expected':>15}{'z expected':>12}")
    for name in all_of[0]:
        columns = [
            float(np.median([getattr(row[name], column) for row in all_of]))
            for column in ("plane", "height", "plane_expected", "height_expected")
        ]
        print(f"{name:22}{columns[0]:8.1f}{columns[1]:8.1f}{columns[2]:15.1f}{columns[3]:12.1f}")
    for ours, theirs in (
        ("heights", "printer, heights"), ("heights + calipers", "printer, + calipers"),
        ("the same, upright", "printer, + calipers"),
    ):  # fmt: skip
        for column in ("plane", "height") if ours in all_of[0] else ():
            pairs = [(getattr(r[ours], column), getattr(r[theirs], column)) for r in all_of]
            apart = np.array([a - b for a, b in pairs])
            # Of the median by its asymptotic spread, 1.2533 sigma / sqrt(n).
            error = 1.2533 * float(np.std(apart, ddof=1)) / np.sqrt(len(apart))
            print(f"{ours} less {theirs}, {column}: {np.median(apart):+.1f} +- {error:.1f}")


if __name__ == "__main__":
    main()
