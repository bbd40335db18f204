"""See which parameters readings can tell apart, and what another reading would buy"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from app.analysis_options import chosen_machine, machine_options

if TYPE_CHECKING:
    import numpy as np

    from calib.analysis.observation import Sights
    from calib.arrays import Array
    from calib.mechanism.description import Machine
    from calib.poses.reach import PoseSet

POSES, FRESH = 60, 300
NEST_RADIUS = 100.0
"""Radius in mm on which nests are assumed where no site says otherwise."""


@click.command()
@machine_options
@click.option(
    "--read",
    type=click.Choice(["nests", "poses", "positions", "heights"]),
    default="nests",
    show_default=True,
    help="What is read at each pose: SMR nests, the whole pose, the platform's origin, or the "
    "nests' heights over the base.",
)
@click.option(
    "--nests",
    "nest_count",
    type=click.IntRange(1),
    default=3,
    show_default=True,
    help="Nests that are assumed.",
)
@click.option("--site", "site_file", type=click.Path(path_type=Path), help="Nests of a site file.")
@click.option("--sigma-um", type=float, help="Standard uncertainty of a reading per axis, um.")
@click.option("--frame-free/--frame-known", default=True, show_default=True, help="Base frame.")
@click.option("--nests-free/--nests-known", default=False, show_default=True, help="Nest centres.")
@click.option("--no-base-nests", is_flag=True, help="Nothing on the base is read.")
@click.option(
    "--poses",
    type=click.IntRange(1),
    help="Random reachable poses [60; a pointing machine: every 10 deg].",
)
@click.option("--poses-file", type=click.Path(path_type=Path), help="These poses instead.")
@click.option("--only", default="", help="A choice of parameters to judge: limb?.0dx1,limb5.*")
@click.option(
    "--seed", type=click.IntRange(0), default=1, show_default=True, help="Seed of the random poses."
)
@answer.json_option
def command(
    machine_name: str,
    closure: str,
    read: str,
    nest_count: int,
    site_file: Path | None,
    sigma_um: float | None,
    frame_free: bool,
    nests_free: bool,
    no_base_nests: bool,
    poses: int | None,
    poses_file: Path | None,
    only: str,
    seed: int,
    as_json: bool,
) -> None:
    """Rank, groups that cannot be told apart, gauge freedoms, and what another reading would buy.

    Exactly invisible combinations and those that are only too weak for the tolerances are told
    apart. Predicted errors show that a choice of the most sensitive parameters is not a choice of
    identifiable ones.
    """
    import numpy as np

    from app.show.identifiability_words import report
    from calib.analysis.benefit import options
    from calib.analysis.coverage import workspace_poses
    from calib.analysis.gauge import gauges
    from calib.analysis.identifiability import identifiability
    from calib.analysis.observation import judge, observe
    from calib.analysis.subsets import compare_subsets, matching

    machine = chosen_machine(machine_name, closure)
    generator = np.random.default_rng(seed)
    where = _poses(machine, poses, poses_file, generator)
    fresh = workspace_poses(machine, FRESH, generator)
    sights = _sights(read, nest_count, site_file, sigma_um, frame_free, nests_free, no_base_nests)
    observation = observe(where, sights)
    found = identifiability(observation)
    judged = judge(fresh, observation)
    named = matching(_parameters(machine), only.split(",")) if only else None
    data, text = report(
        machine,
        sights.says,
        where.count,
        found,
        gauges(where, NEST_RADIUS),
        compare_subsets(observation, judged, found.base, named),
        options(machine, where, fresh, sights, generator),
    )
    head: dict[str, Any] = {
        "format": "pkm-identifiability/1",
        "machine": machine.name,
        "closure": closure or "own",
    }
    answer.show({**head, **data}, as_json, text)


def _poses(
    machine: "Machine", count: int | None, file: Path | None, generator: "np.random.Generator"
) -> "PoseSet":
    from app.files.poses import read_pose_file
    from calib.analysis.coverage import workspace_poses
    from calib.poses.reach import sample_poses

    if file:
        return read_pose_file(file, machine).pose_set
    if count is None:
        return workspace_poses(machine, POSES, generator)
    return sample_poses(machine, count, generator)


def _parameters(machine: "Machine") -> list[str]:
    return [p.name for p in machine.parameters]


def _sights(
    read: str,
    nest_count: int,
    site_file: Path | None,
    sigma_um: float | None,
    frame_free: bool,
    nests_free: bool,
    no_base_nests: bool,
) -> "Sights":
    import numpy as np

    from app.files.poses import nest_matrix
    from app.files.site import load_site
    from calib.analysis.observation import Sights
    from calib.poses.readings import HAN_2020, DirectionReadings, PoseNoise

    sigma = 5.0 if sigma_um is None else sigma_um
    if sigma <= 0.0:
        raise click.BadParameter("the uncertainty must be positive", param_hint="--sigma-um")
    if site_file:
        site = load_site(site_file)
        platform, base = nest_matrix(site.platform_nests), nest_matrix(site.base_nests)
    else:
        platform, base = _circle(nest_count, NEST_RADIUS), _circle(3, 2.6 * NEST_RADIUS)
    base = base[:, :0] if no_base_nests else base
    if read == "nests":
        return Sights(platform, sigma * 1e-3, base, frame_free=frame_free, nests_free=nests_free)
    if read == "heights":
        heights = DirectionReadings(platform, np.array([[0.0], [0.0], [1.0]]), sigma * 1e-3)
        return Sights(np.zeros((3, 0)), sigma * 1e-3, pose_noise=heights)
    whole = HAN_2020 if sigma_um is None else PoseNoise(sigma * 1e-3, HAN_2020.angle_sigma)
    noise = whole if read == "poses" else PoseNoise(whole.position_sigma, None)
    none = np.zeros((3, 0))
    return Sights(none, sigma * 1e-3, base, frame_free=frame_free, pose_noise=noise)


def _circle(count: int, radius: float) -> "Array":
    """Nests on a circle about the z axis, (3, count); the first towards y."""
    import numpy as np

    angle = np.pi / 2.0 + 2.0 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)])
