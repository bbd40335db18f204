"""Judge accuracy and repeatability by ISO 9283, from a run with cycles"""

import math
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from calib.digits import fixed
from calib.errors import BadInput

if TYPE_CHECKING:
    from calib.analysis.cycles import Attained, Campaign
    from calib.analysis.iso9283 import DistanceResult, PoseResult

MIXED = 3.0
"""How many times more than the poses' repeatability allows a distance may scatter."""


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--point", default="", help="Judge the SMR in this nest, not the platform's origin.")
@click.option("--pairs", default="", help="Pairs for the distances, P2:P4,P1:P3; else neighbours.")
@answer.json_option
def command(run: Path, point: str, pairs: str, as_json: bool) -> None:
    """Pose accuracy AP and repeatability RP, distance accuracy AD and repeatability RD.

    The run repeats the same poses in cycles (pkmcal measure --cycles 30). With three nests read at
    a pose the whole pose is judged, else the SMR's centre.
    """
    from app.files.runs import read_run
    from calib.analysis.cycles import campaign

    loaded = read_run(run)
    held = campaign(loaded.machine, loaded.run, point)
    results = [(pose, _judge(pose)) for pose in held.poses]
    distances = [
        (first.label, second.label, found)
        for first, second in _chosen_pairs(held, pairs)
        if (found := _distance(first, second)) is not None
    ]
    data = {
        "format": "pkm-iso9283/1",
        "machine": loaded.machine.name,
        "point": held.point,
        "frame": held.frame,
        "left_out": held.left_out,
        "poses": [_pose_data(pose, found) for pose, found in results],
        "distances": [_distance_data(*row) for row in distances],
        "largest": {
            "AP_mm": max(found.accuracy for _, found in results),
            "RP_mm": max(found.repeatability for _, found in results),
            "AD_mm": max((found.accuracy for *_, found in distances), key=abs, default=None),
            "RD_mm": max((found.repeatability for *_, found in distances), default=None),
        },
    }
    answer.show(data, as_json, _text(loaded.machine.name, held, results, distances))


def _judge(pose: "Attained") -> "PoseResult":
    from calib.analysis.iso9283 import pose_result

    angles = None
    if pose.command_angles is not None and pose.attained_angles is not None:
        angles = (pose.command_angles, pose.attained_angles)
    return pose_result(pose.command, pose.attained, angles)


def _chosen_pairs(held: "Campaign", pairs: str) -> "list[tuple[Attained, Attained]]":
    if not pairs:
        return list(pairwise(held.poses))
    by_label = {pose.label: pose for pose in held.poses}
    chosen = []
    for pair in pairs.split(","):
        first, colon, second = pair.strip().partition(":")
        for label in (first, second):
            if not colon or label not in by_label:
                raise BadInput(
                    f'"{pair}" in --pairs',
                    remedy=f"Write P1:P2 with two of {', '.join(by_label)}.",
                )
        chosen.append((by_label[first], by_label[second]))
    return chosen


def _distance(first: "Attained", second: "Attained") -> "DistanceResult | None":
    """Judge a pair over the cycles in which both were visited; None for fewer than two."""
    from calib.analysis.iso9283 import distance_result

    common = sorted(set(first.cycles) & set(second.cycles))
    if len(common) < 2:
        return None
    columns = [pose.attained[:, [pose.cycles.index(c) for c in common]] for pose in (first, second)]
    return distance_result((first.command, second.command), (columns[0], columns[1]))


def _pose_data(pose: "Attained", found: "PoseResult") -> dict[str, Any]:
    import numpy as np

    data: dict[str, Any] = {
        "label": pose.label,
        "cycles": found.cycles,
        "AP_mm": found.accuracy,
        "AP_xyz_mm": found.accuracy_xyz,
        "RP_mm": found.repeatability,
        "barycentre_mm": found.barycentre,
    }
    if found.accuracy_angles is not None and found.repeatability_angles is not None:
        data["AP_angles_deg"] = np.rad2deg(found.accuracy_angles)
        data["RP_angles_deg"] = np.rad2deg(found.repeatability_angles)
    return data


def _distance_data(first: str, second: str, found: "DistanceResult") -> dict[str, Any]:
    return {
        "pair": [first, second],
        "cycles": found.cycles,
        "commanded_mm": found.commanded,
        "AD_mm": found.accuracy,
        "AD_xyz_mm": found.accuracy_xyz,
        "RD_mm": found.repeatability,
        "RD_xyz_mm": found.repeatability_xyz,
        "RD_expected_from_RP_mm": found.allowed,
    }


def _text(
    machine: str,
    held: "Campaign",
    results: "list[tuple[Attained, PoseResult]]",
    distances: "list[tuple[str, str, DistanceResult]]",
) -> str:
    rows = [
        [
            pose.label,
            str(found.cycles),
            f"{found.accuracy:.4f}",
            *(fixed(value, 4, signed=True) for value in found.accuracy_xyz),
            f"{found.repeatability:.4f}",
            *_angle_cells(found),
        ]
        for pose, found in results
    ]
    header = ["pose", "n", "AP", "AP_x", "AP_y", "AP_z", "RP"]
    if any(found.accuracy_angles is not None for _, found in results):
        header += ["AP_a deg", "RP_a deg"]
    parts = [
        f"{machine}: {len(results)} poses, {held.point}; base frame from {held.frame}; mm",
        answer.table(header, rows),
    ]
    if distances:
        rows = [
            [
                f"{first} - {second}",
                f"{d.commanded:.3f}",
                fixed(d.accuracy, 4, signed=True),
                *(fixed(value, 4, signed=True) for value in d.accuracy_xyz),
                f"{d.repeatability:.4f}",
                f"{d.allowed:.4f}",
            ]
            for first, second, d in distances
        ]
        header = ["pair", "distance", "AD", "AD_x", "AD_y", "AD_z", "RD +-", "expected"]
        parts.append(answer.table(header, rows))
    parts.append(_summary(held, results, distances))
    return "\n\n".join(parts)


def _angle_cells(found: "PoseResult") -> list[str]:
    """Largest angle of AP and of RP, deg."""
    if found.accuracy_angles is None or found.repeatability_angles is None:
        return []
    turned = max(abs(float(one)) for one in found.accuracy_angles)
    spread = max(float(one) for one in found.repeatability_angles)
    return [f"{math.degrees(turned):.4f}", f"{math.degrees(spread):.4f}"]


def _summary(
    held: "Campaign",
    results: "list[tuple[Attained, PoseResult]]",
    distances: "list[tuple[str, str, DistanceResult]]",
) -> str:
    from calib.analysis.iso9283 import CYCLES

    worst = max(results, key=lambda row: row[1].accuracy)
    loose = max(results, key=lambda row: row[1].repeatability)
    lines = [
        f"AP {worst[1].accuracy:.4f} mm at {worst[0].label}, RP {loose[1].repeatability:.4f} mm at "
        f"{loose[0].label}: the largest count."
    ]
    fewest = min(found.cycles for _, found in results)
    if fewest < CYCLES:
        lines.append(f"ISO 9283 asks for {CYCLES} cycles; the fewest here are {fewest}.")
    if held.left_out:
        lines.append(f"Left out, visited in fewer than two cycles: {', '.join(held.left_out)}.")
    mixed = [f"{a} - {b}" for a, b, d in distances if d.repeatability > MIXED * d.allowed]
    if mixed:
        lines.append(
            f"The distances {', '.join(mixed)} scatter more than {MIXED:g} times what the poses' "
            "own repeatability allows: the frame or a reference moved between the cycles."
        )
    return "\n".join(lines)
