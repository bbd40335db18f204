"""A simulated campaign as files: run.toml, points.csv (docs/run-format.md) and truth."""

import json
from pathlib import Path

import numpy as np

from calib.runs import Digits, Header, Load, Run, covariance_matrices, format_header, format_points
from mocks.physics.pose import Array
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import SimulatedRun


def run_toml(run: SimulatedRun) -> str:
    """The text of ``run.toml``."""
    return format_header(_header(run))


def points_csv(run: SimulatedRun) -> str:
    """The text of ``points.csv``."""
    return format_points(as_run(run), digits(run.plan))


def digits(plan: RunPlan) -> Digits:
    """What the instruments of a campaign show of each number."""
    return Digits(
        time=".2f", q=f".{plan.body.stroke.digits}f", position=".6f", sigma=".6f",
        covariance=".6e", channel=".3f", channels={"delay_s": ".2f", "cycle": ".0f"},
    )  # fmt: skip


def as_run(run: SimulatedRun) -> Run:
    """What was measured, without the truth about it."""
    rows = run.layout
    labels = zip(rows.pose.tolist(), rows.labelled.tolist(), strict=True)
    return Run(
        header=_header(run),
        source="simulated",
        line=np.arange(len(rows.nest)) + 2,
        time_s=rows.time,
        pose=tuple(_label(pose) if labelled else "" for pose, labelled in labels),
        nest=rows.nest,
        q=run.q.T,
        measured=rows.reading,
        position=run.xyz.T,
        covariance=covariance_matrices(np.where(rows.reading, run.covariance.T, np.nan)),
        channels=_channels(run),
        left_aside={},
    )


def _label(pose: int) -> str:
    return "home" if pose < 0 else str(pose + 1)


def _channels(run: SimulatedRun) -> dict[str, Array]:
    if run.plan.cycles <= 1:
        return dict(run.channels)
    cycle = run.layout.cycle
    return {"cycle": np.where(cycle > 0, cycle, np.nan), **run.channels}


def _header(run: SimulatedRun) -> Header:
    plan, around = run.plan, run.plan.body.around
    load = plan.load or around.load
    nests = plan.nests or around.platform_nests
    return Header(
        machine=plan.machine,
        title=plan.title or f"{plan.machine}, {len(run.poses)} poses, {len(nests)} nests",
        tracker={"model": "AT901-LR"},
        platform_nests={name: np.array(place) for name, place in around.platform_nests.items()},
        base_nests={name: np.array(place) for name, place in around.base_nests.items()},
        controller_parameters=dict(plan.controller),
        load=Load(
            np.array(load.gravity),
            load.platform_mass_kg,
            np.array(load.platform_com),
            np.array(load.payload_com),
        ),
    )


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
