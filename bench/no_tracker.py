"""A delta without a laser tracker: heights, calipers on a printed part, and a tracker beside them.

    python -m bench no_tracker [--seeds N] [--page]

Two worlds of machines: those that the drawing of ``delta`` allows (towers lean, each at a radius
of its own, the two rods of a pair differ), and those of which ``delta-printer``, what the firmware
of 3D printers assumes, is the whole truth. Each machine is probed at 30 places of the bed; 12
distances between marks at these places are measured with calipers; and besides a part that stands
100 mm high is measured with them across its top and from its foot to its top. The same numbers go
to the least squares that printers use (bench/_tower_delta.py) and to runs of version 2, fitted with
either machine file. Judged at 300 fresh poses up to 120 mm above the bed, after the one shift and
turn in the plane of the bed that no reading can know. ``--page`` writes the tables into
docs/no-laser-tracker.md.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from bench._tower_delta import Measured, calibrate, effector
from calib.arrays import Array, IntArray
from calib.discover.agreement import more_than_noise
from calib.identify import Fit, fit
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import exponential
from calib.mechanism.solve import forward, inverse
from calib.model import Model
from calib.poses.reach import PoseSet, sample_poses
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.kinds import Laboratory, Stand

HEIGHTS, DISTANCES, FRESH = 30, 12, 300
PROBE_MM, CALIPERS_MM, TRACKER_MM = 0.010, 0.020, 0.010
BED, TALL, REACH = 40.0, 100.0, 60.0
PAGE = Path("docs/no-laser-tracker.md")

WORLDS = {
    "leaning": "towers lean, each at a radius of its own, the rods of a pair differ",
    "upright": "upright towers at one radius, rods equal in pairs",
}
READ = {
    "heights": "heights",
    "calipers": "heights + calipers",
    "part": "the same + a tall part",
    "tracker": "tracker at the same 30 places",
}
PRINTER = "printer's least squares"
FILES = ("delta-printer", "delta")


@dataclass(frozen=True, eq=False)
class Judged:
    """RMS errors at fresh poses, um: in the plane and in height; and what the fit expected.

    ``doubted``: the fit says that more is left than noise; nan where there is no fit.
    """

    plane: float
    height: float
    plane_expected: float = float("nan")
    height_expected: float = float("nan")
    doubted: float = float("nan")


def drawn(machine: Machine, rng: np.random.Generator, world: str) -> Array:
    """Parameters (P,) uniform within the tolerances; upright: what a printer's model can say."""
    off = machine.tolerance * rng.uniform(-1.0, 1.0, machine.nominal.size)
    names = [parameter.name for parameter in machine.parameters]
    for k, name in enumerate(names) if world == "upright" else ():
        tower, _, what = name.partition(".")
        if what.startswith("lean") or (what, tower) == ("azimuth", "tower3"):
            off[k] = 0.0
        elif what == "length_b":
            off[k] = off[names.index(f"{tower}.length_a")]
        elif what == "radius":
            off[k] = off[names.index("tower1.radius")]
    return np.asarray(machine.nominal + off)


def probed(machine: Machine, height: float = BED) -> Array:
    """q (3, N) at which a nominal machine stands over the bed: a spiral of Vogel's sunflower."""
    k = np.arange(HEIGHTS)
    radius, angle = REACH * np.sqrt((k + 0.5) / HEIGHTS), k * np.pi * (3.0 - np.sqrt(5.0))
    task = np.array([radius * np.cos(angle), radius * np.sin(angle), np.full(HEIGHTS, height)])
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


def measured(machine: Machine, real: Array, seed: int) -> tuple[Measured, dict[str, str]]:
    """Numbers for the printer's least squares; points.csv by what is read, and run.toml."""
    q, above = probed(machine), probed(machine, BED + TALL)
    low, high = (forward(machine, machine.extension(one), real).poses for one in (q, above))
    pairs = ends(q)
    texts: dict[str, str] = {}
    for what in READ:
        lab = laboratory(machine, real, q, np.random.default_rng(seed))
        for k in range(HEIGHTS):
            lab.go(f"{k}", q[:, k].tolist(), low.position[:, k], low.rotation[:, :, k])
            if what == "tracker":
                lab.point("tool", TRACKER_MM, by="tracker")
            else:
                lab.point("tool", PROBE_MM, by="probe", only="z")
        if what in ("calipers", "part"):
            for first, second in pairs.T:
                lab.marks("tool", f"{first}", f"{second}", CALIPERS_MM, by="calipers")
        if what == "part":
            for k in pairs[0]:
                place, turn = high.position[:, k], high.rotation[:, :, k]
                lab.go(f"top {k}", above[:, k].tolist(), place, turn)
                lab.move()
            for first, second in pairs.T:
                for one, other in ((f"top {first}", f"top {second}"), (first, f"top {second}")):
                    lab.marks("tool", f"{one}", other, CALIPERS_MM, by="calipers")
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
    along = 1000.0 * np.sqrt(np.array(expected) / true.shape[1])
    return Judged(plane, height, *along, float(bool(more_than_noise(found))))


def one(
    machines: Mapping[str, Machine], world: str, seed: int, fresh: PoseSet
) -> dict[str, Judged]:
    """One machine, measured and judged in every way: by method and what was read."""
    machine = machines["delta"]
    real = drawn(machine, np.random.default_rng(seed), world)
    true = forward(machine, machine.extension(fresh.q), real).poses.position
    numbers, texts = measured(machine, real, seed)
    found = {"before": Judged(*judge(fresh.poses.position - true, true))}
    alone = Measured(numbers.q, numbers.heights, np.zeros(0), np.zeros((2, 0), dtype=np.intp))
    for what, data in (("heights", alone), ("calipers", numbers)):
        off = effector(calibrate(data), fresh.q) - true
        found[f"{PRINTER}, {READ[what]}"] = Judged(*judge(off, true))
    for file in FILES:
        for what, name in READ.items():
            run = parse_run(texts["header"], texts[what], actuators=3)
            model = Model(stack(machines[file], [run]))
            found[f"`{file}`, {name}"] = judged(fit(model), machines[file], fresh, true)
    return found


def table(all_of: list[dict[str, Judged]], world: str) -> list[str]:
    """Lines of the table of one world: medians over the machines."""
    lines = [
        f"| {WORLDS[world]}: um | x, y | z | x, y expected | z expected "
        "| something is missing, says the fit |",
        "|---|---|---|---|---|---|",
    ]
    for name in all_of[0]:
        rows = [row[name] for row in all_of]
        cells = [f"{np.median([row.plane for row in rows]):.1f}"]
        cells += [f"{np.median([row.height for row in rows]):.1f}"]
        for column in ("plane_expected", "height_expected"):
            value = float(np.median([getattr(row, column) for row in rows]))
            cells += ["" if np.isnan(value) else f"{value:.1f}"]
        doubted = [row.doubted for row in rows]
        cells += ["" if np.isnan(doubted[0]) else f"{sum(doubted):.0f} of {len(rows)}"]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def paired(all_of: list[dict[str, Judged]], ours: str, theirs: str) -> str:
    """Cells of a row: differences of two methods on the same machines, with standard errors."""
    cells = [ours, theirs]
    for column in ("plane", "height"):
        apart = np.array([getattr(r[ours], column) - getattr(r[theirs], column) for r in all_of])
        # Of the median by its asymptotic spread, 1.2533 sigma / sqrt(n).
        error = 1.2533 * float(np.std(apart, ddof=1)) / np.sqrt(len(apart))
        cells.append(f"{np.median(apart):+.1f} +- {error:.1f}")
    return " | ".join(cells)


def main() -> None:
    """Print medians over the machines, and the paired differences to the printer's method."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--page", action="store_true", help=f"write the tables into {PAGE}")
    asked = parser.parse_args()
    machines = {name: load_machine(name) for name in FILES}
    fresh = sample_poses(machines["delta"], FRESH, np.random.default_rng(7))
    lines, apart = [], ["| world | ours | beside | x, y | z |", "|---|---|---|---|---|"]
    for world in WORLDS:
        all_of = [one(machines, world, seed, fresh) for seed in range(1, asked.seeds + 1)]
        lines += [*table(all_of, world), ""]
        for file in FILES:
            for what in ("heights", "calipers"):
                both = f"`{file}`, {READ[what]}", f"{PRINTER}, {READ[what]}"
                apart.append(f"| {world} | {paired(all_of, *both)} |")
    text = "\n".join([*lines, *apart])
    print(text)
    if asked.page:
        write(text)


def write(text: str) -> None:
    """Put the tables between the marks of the page."""
    whole = PAGE.read_text(encoding="utf-8")
    before, mark, rest = whole.partition("<!-- no tracker -->")
    _, end, after = rest.partition("<!-- end -->")
    if not (mark and end):
        raise SystemExit(f"{PAGE} has no marks <!-- no tracker --> and <!-- end -->")
    PAGE.write_text(f"{before}{mark}\n\n{text}\n\n{end}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
