"""A simulated campaign as files: run.toml, points.csv (formats.md of the project) and truth."""

import json
from pathlib import Path

import numpy as np
import tomli_w

from mocks.physics.room import BASE_NESTS, PLATFORM_NESTS
from mocks.simulate.run import SimulatedRun


def run_toml(run: SimulatedRun) -> str:
    """The text of ``run.toml``."""
    plan = run.plan
    table: dict[str, object] = {
        "format": "pkm-run/1",
        "machine": "hexapod",
        "title": plan.title or f"hexapod, {len(run.poses)} poses, {len(plan.nests)} nests",
        "tracker": {"model": "AT901-LR"},
        "nests": {
            "platform": {k: list(v) for k, v in PLATFORM_NESTS.items()},
            "base": {k: list(v) for k, v in BASE_NESTS.items()},
        },
        "load": {
            "gravity": list(plan.load.gravity),
            "platform_mass_kg": plan.load.platform_mass_kg,
            "platform_com": list(plan.load.platform_com),
            "payload_com": list(plan.load.payload_com),
        },
    }
    if plan.controller:
        table["controller"] = {"parameters": dict(plan.controller)}
    return tomli_w.dumps(table)


def points_csv(run: SimulatedRun) -> str:
    """The text of ``points.csv``."""
    mixed = run.plan.noise_mm is None
    sigma = np.sqrt(run.covariance[:, :3])
    header = ["time_s", "pose", "nest", *(f"q{i + 1}" for i in range(run.q.shape[1]))]
    header += ["x", "y", "z", "sx", "sy", "sz", *(["sxy", "sxz", "syz"] if mixed else [])]
    header += [*(["cycle"] if run.plan.cycles > 1 else []), *run.channels]
    lines = [",".join(header)]
    channels = np.column_stack(list(run.channels.values())).tolist()
    places = [2 if name == "delay_s" else 3 for name in run.channels]
    rows = zip(
        run.layout.time.tolist(), run.layout.pose.tolist(), run.layout.labelled.tolist(),
        run.layout.nest, run.q.tolist(), run.xyz.tolist(), sigma.tolist(),
        run.covariance[:, 3:].tolist(), channels, run.layout.cycle.tolist(), strict=True,
    )  # fmt: skip
    for time, pose, labelled, nest, q, xyz, s, cov, values, cycle in rows:
        label = ("home" if pose < 0 else str(pose + 1)) if labelled else ""
        cells = [f"{time:.2f}", label, nest, *(f"{v:.6f}" for v in q)]
        if nest:
            cells += [f"{v:.6f}" for v in (*xyz, *s)]
            cells += [f"{v:.6e}" for v in cov] if mixed else []
        else:
            cells += [""] * (9 if mixed else 6)
        if run.plan.cycles > 1:
            cells.append(str(cycle) if cycle else "")
        cells += [f"{v:.{n}f}" for v, n in zip(values, places, strict=True)]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def truth_json(run: SimulatedRun) -> str:
    """The truth about a run, for judges."""
    plan = run.plan
    truth = {
        "hidden": plan.hidden.values,
        "sigma_mm": plan.noise_mm,
        "seed": plan.seed,
        "parameters": dict(run.parameters),
        "frame": run.frame,
        "bad_lines": [row + 2 for row in run.strays],
    }
    return json.dumps(truth, indent=1)


def write(run: SimulatedRun, folder: Path, truth: Path | None = None) -> None:
    """Write the two files of a run, and its truth to ``truth`` (default: beside them)."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "run.toml").write_text(run_toml(run), encoding="utf-8", newline="\n")
    (folder / "points.csv").write_text(points_csv(run), encoding="utf-8", newline="\n")
    (truth or folder / "truth.json").write_text(truth_json(run), encoding="utf-8")


def read_poses(path: Path) -> np.ndarray:
    """Poses from a CSV file with columns x, y, z (mm), rx, ry, rz (rad, or rx_deg ...): (N, 6).

    Other columns are ignored. Raises ValueError for a missing column or a cell without a number.
    """
    lines = [line.split(",") for line in path.read_text(encoding="utf-8").split("\n") if line]
    names = [name.strip() for name in lines[0]] if lines else []
    columns = []
    for name in ("x", "y", "z", "rx", "ry", "rz"):
        key = name if name in names else f"{name}_deg"
        if key not in names:
            raise ValueError(f"{path}: no column {name}; columns are x, y, z, rx, ry, rz")
        values = np.array([float(line[names.index(key)]) for line in lines[1:]])
        columns.append(np.radians(values) if key.endswith("_deg") else values)
    return np.column_stack(columns)
