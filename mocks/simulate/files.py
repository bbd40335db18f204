"""A simulated campaign as files: run.toml, points.csv, and apart from them the truth."""

import json
from pathlib import Path

import numpy as np
import tomli_w

from mocks.physics.bodies import body_named
from mocks.simulate.run import SimulatedRun


def run_toml(run: SimulatedRun) -> str:
    """The text of ``run.toml``."""
    plan = run.plan
    around = body_named(plan.machine).around
    load = plan.load or around.load
    nests = plan.nests or around.platform_nests
    table: dict[str, object] = {
        "format": "pkm-run/1",
        "machine": plan.machine,
        "title": plan.title or f"{plan.machine}, {len(run.poses)} poses, {len(nests)} nests",
        "tracker": {"model": "AT901-LR"},
        "nests": {
            "platform": {k: list(v) for k, v in around.platform_nests.items()},
            "base": {k: list(v) for k, v in around.base_nests.items()},
        },
        "load": {
            "gravity": list(load.gravity),
            "platform_mass_kg": load.platform_mass_kg,
            "platform_com": list(load.platform_com),
            "payload_com": list(load.payload_com),
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
    digits = body_named(run.plan.machine).stroke.digits
    places = [2 if name == "delay_s" else 3 for name in run.channels]
    rows = zip(
        run.layout.time.tolist(), run.layout.pose.tolist(), run.layout.labelled.tolist(),
        run.layout.nest, run.q.tolist(), run.xyz.tolist(), sigma.tolist(),
        run.covariance[:, 3:].tolist(), channels, run.layout.cycle.tolist(), strict=True,
    )  # fmt: skip
    for time, pose, labelled, nest, q, xyz, s, cov, values, cycle in rows:
        label = ("home" if pose < 0 else str(pose + 1)) if labelled else ""
        cells = [f"{time:.2f}", label, nest, *(f"{v:.{digits}f}" for v in q)]
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
