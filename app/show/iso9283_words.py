"""Accuracy and repeatability by ISO 9283, in words."""

import math

from app.show.text_table import text_table
from calib.analysis.cycles import Attained, Campaign
from calib.analysis.iso9283 import CYCLES, DistanceResult, PoseResult
from calib.digits import fixed

MIXED = 3.0
"""How many times more than the poses' repeatability allows a distance may scatter."""


def iso9283_words(
    machine: str,
    held: Campaign,
    results: list[tuple[Attained, PoseResult]],
    distances: list[tuple[str, str, DistanceResult]],
) -> str:
    """The answer for a person: a table of poses, one of distances, what counts."""
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
        text_table(header, rows),
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
        parts.append(text_table(header, rows))
    parts.append(_summary(held, results, distances))
    return "\n\n".join(parts)


def _angle_cells(found: PoseResult) -> list[str]:
    """Largest angle of AP and of RP, deg."""
    if found.accuracy_angles is None or found.repeatability_angles is None:
        return []
    turned = max(abs(float(one)) for one in found.accuracy_angles)
    spread = max(float(one) for one in found.repeatability_angles)
    return [f"{math.degrees(turned):.4f}", f"{math.degrees(spread):.4f}"]


def _summary(
    held: Campaign,
    results: list[tuple[Attained, PoseResult]],
    distances: list[tuple[str, str, DistanceResult]],
) -> str:
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
