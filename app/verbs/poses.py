"""Choose where to measure, and see what accuracy to expect"""

from pathlib import Path
from typing import Any

import click
import numpy as np

from app import answer
from app.files.machines import load_machine
from app.files.pose_table import poses_text
from app.files.poses import full_poses, nest_matrix, render_design, render_pose_file
from app.files.site import load_site
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.poses.design import CANDIDATES, TABLE, Design, design_poses
from calib.poses.information import Accuracy
from calib.poses.readings import HAN_2020, NestReadings, PoseNoise, Readings
from calib.poses.verification import verification_poses

ANGLES = ("rx", "ry", "rz", "tilt", "azimuth")


@click.command()
@click.argument("machine_name", metavar="[MACHINE]", default="")
@click.option("--machine", "machine_option", default="", help="Shipped machine or machine file.")
@click.option(
    "--n",
    "count",
    type=click.IntRange(1),
    default=29,
    show_default=True,
    help="How many poses to choose.",
)
@click.option(
    "--criterion",
    type=click.Choice(["I", "D"]),
    default="I",
    show_default=True,
    help="I: smallest predicted pose error; D: most information about the parameters.",
)
@click.option(
    "--priors/--no-priors", default=True, show_default=True, help="Use the tolerances as priors."
)
@click.option("--site", "site_file", type=click.Path(path_type=Path), help="Nests of a site file.")
@click.option("--sigma-um", type=float, help="Standard uncertainty of a reading per axis, um.")
@click.option("--angle-mdeg", type=float, help="The same of an angle, where poses are read whole.")
@click.option(
    "--candidates",
    type=click.IntRange(1),
    default=CANDIDATES,
    show_default=True,
    help="Reachable candidates.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the candidates."
)
@click.option("--verification", is_flag=True, help="Write the verification grid instead.")
@click.option("--out", type=click.Path(path_type=Path), help="Write a poses file for measure.")
@answer.json_option
def command(
    machine_name: str,
    machine_option: str,
    count: int,
    criterion: str,
    priors: bool,
    site_file: Path | None,
    sigma_um: float | None,
    angle_mdeg: float | None,
    candidates: int,
    seed: int,
    verification: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Choose measurement poses among reachable ones and predict what accuracy they will give.

    The table tells what other numbers of poses would give, so that you can choose. The poses are
    ordered for a short path; the whole path has been checked against the limits.
    """
    machine = _machine(machine_name, machine_option, site_file)
    if verification:
        _write_verification(machine, out, as_json)
        return
    readings = _readings(machine, site_file, sigma_um, angle_mdeg)
    with answer.working(f"choosing {count} of {candidates} reachable poses"):
        design = design_poses(
            machine,
            readings,
            count,
            np.random.default_rng(seed),
            criterion="D" if criterion == "D" else "I",
            priors=priors,
            candidates=candidates,
            counts=[n for n in TABLE if n <= candidates],
        )
    if out:
        # What brings the same poses again stands in the file.
        comment = (
            f"pkmcal poses {machine_name or machine_option or machine.name} --n {count} "
            f"--criterion {criterion} --seed {seed} --candidates {candidates}"
        )
        comment += "" if priors else " --no-priors"
        comment += f" --site {site_file}" if site_file else ""
        comment += f" --sigma-um {sigma_um:g}" if sigma_um is not None else ""
        comment += f" --angle-mdeg {angle_mdeg:g}" if angle_mdeg is not None else ""
        bare = poses_text(full_poses(design.labels, design.pose_set))
        text = bare if out.suffix == ".csv" else render_design(design, seed, comment)
        out.write_text(text, encoding="utf-8")
        answer.say(f"written to {out}")
    answer.show(_data(design, seed), as_json, _text(design))


def _machine(name: str, option: str, site_file: Path | None) -> Machine:
    if name and option:
        raise BadInput("two machines are named", remedy="Give MACHINE or --machine, not both.")
    if name or option:
        return load_machine(name or option)
    if site_file:
        return load_site(site_file).machine
    raise BadInput("no machine is named", remedy="Write pkmcal poses hexapod, or give --site.")


def _readings(
    machine: Machine, site_file: Path | None, sigma_um: float | None, angle_mdeg: float | None
) -> Readings:
    """Nests of the site, or whole poses with the noise of Han et al. 2020 if nothing is said."""
    for value, what in ((sigma_um, "--sigma-um"), (angle_mdeg, "--angle-mdeg")):
        if value is not None and value <= 0.0:
            raise BadInput(f"{what} is {value:g}", remedy="Give a positive uncertainty.")
    if site_file:
        site = load_site(site_file)
        sigma = (5.0 if sigma_um is None else sigma_um) * 1e-3
        return NestReadings(nest_matrix(site.platform_nests), sigma, nest_matrix(site.base_nests))
    sigma = HAN_2020.position_sigma if sigma_um is None else sigma_um * 1e-3
    if angle_mdeg is not None:
        return PoseNoise(sigma, float(np.deg2rad(angle_mdeg * 1e-3)))
    turns = any(name in ANGLES for name in machine.task.coordinates)
    return PoseNoise(sigma, HAN_2020.angle_sigma if turns else None)


def _accuracy(accuracy: Accuracy) -> dict[str, float]:
    return {
        "position_rms_um": accuracy.position_um,
        "orientation_rms_mdeg": accuracy.orientation_mdeg,
    }


def _data(design: Design, seed: int) -> dict[str, Any]:
    names = design.machine.task.coordinates
    return {
        "format": "pkm-design/1",
        "machine": design.machine.name,
        "criterion": design.criterion,
        "readings": design.readings,
        "tolerances_as_priors": design.priors,
        "candidates": design.candidates,
        "seed": seed,
        "predicted": _accuracy(design.accuracy),
        "random_poses": _accuracy(design.random),
        "by_count": [{"n": n, **_accuracy(a)} for n, a in design.by_count],
        "path_in_strokes": design.length,
        "poses": [
            {"label": label, **dict(zip(names, task, strict=True)), "q": q}
            for label, task, q in zip(
                design.labels, design.pose_set.task.T, design.pose_set.q.T, strict=True
            )
        ],
    }


def _text(design: Design) -> str:
    count = len(design.labels)
    rows = [
        [str(n), f"{a.position_um:.2f}", f"{a.orientation_mdeg:.2f}"]
        for n, a in design.by_count
        if n % 5 == 0
    ]
    table = answer.table(["poses", "position um", "orientation mdeg"], rows)
    prior = "tolerances as priors" if design.priors else "without priors"
    return (
        f"{design.machine.name}: {count} of {design.candidates} reachable poses, criterion "
        f"{design.criterion}, {prior}\nread: {design.readings}\n\n"
        f"predicted RMS at fresh poses: {design.accuracy.position_um:.2f} um, "
        f"{design.accuracy.orientation_mdeg:.2f} mdeg "
        f"({count} random poses: {design.random.position_um:.2f} um)\n"
        f"path: {design.length:.1f} strokes of the slowest actuator, within all limits\n\n{table}"
    )


def _write_verification(machine: Machine, out: Path | None, as_json: bool) -> None:
    grid = verification_poses(machine)
    box = {
        name: [low, high] if name in "xyz" else [float(np.rad2deg(low)), float(np.rad2deg(high))]
        for name, (low, high) in grid.box.items()
    }
    if out:
        comment = f"pkmcal poses {machine.name} --verification"
        title = f"{len(grid.labels)} verification poses for {machine.name}"
        about = {"workspace_scale": grid.scale}
        out.write_text(
            render_pose_file(grid.labels, grid.pose_set, title, about, comment), encoding="utf-8"
        )
        answer.say(f"written to {out}")
    data = {
        "format": "pkm-verification/1",
        "machine": machine.name,
        "workspace_scale": grid.scale,
        "box": box,
        "poses": grid.by_label,
    }
    spans = [
        f"{name} {low:.3f} .. {high:.3f} {'mm' if name in 'xyz' else 'deg'}"
        for name, (low, high) in box.items()
    ]
    text = (
        f"{machine.name}: {len(grid.labels)} verification poses, all within reach, in "
        f"{grid.scale:.3f} of the workspace:\n" + "\n".join(spans)
    )
    answer.show(data, as_json, text)
