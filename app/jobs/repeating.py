"""Accuracy and repeatability by ISO 9283, of a run that repeats its poses in cycles."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.files.runs import read_run
from app.jobs.chosen_runs import File
from app.jobs.record import Record, Report
from app.show.iso9283_words import iso9283_words
from calib.analysis.cycles import Attained, Campaign, campaign
from calib.analysis.iso9283 import DistanceResult, PoseResult, distance_result, pose_result
from calib.errors import BadInput

Xyz = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PoseAccuracy(Record):
    """A pose over its cycles: accuracy AP, repeatability RP, the middle of what was attained.

    Angles (about x, y, z of the base) only where whole poses were read; else None.
    """

    label: str
    cycles: int
    AP_mm: float
    AP_xyz_mm: Xyz
    RP_mm: float
    barycentre_mm: Xyz
    AP_angles_deg: Xyz | None = None
    RP_angles_deg: Xyz | None = None


@dataclass(frozen=True, kw_only=True)
class DistanceAccuracy(Record):
    """A distance between two poses over the cycles of both: accuracy AD, repeatability RD.

    ``RD_expected_from_RP_mm`` is what the repeatability of the two poses alone would make of it.
    """

    pair: tuple[str, str]
    cycles: int
    commanded_mm: float
    AD_mm: float
    AD_xyz_mm: Xyz
    RD_mm: float
    RD_xyz_mm: Xyz
    RD_expected_from_RP_mm: float


@dataclass(frozen=True, kw_only=True)
class Iso9283Report(Report):
    """Pose and distance accuracy and repeatability (``pkm-iso9283/1``); mm and deg, base frame.

    ``largest`` holds ``AP_mm``, ``RP_mm``, ``AD_mm``, ``RD_mm``: None where there is no distance.
    """

    FORMAT: ClassVar[str] = "pkm-iso9283/1"
    machine: str
    point: str
    frame: str
    left_out: tuple[str, ...]
    poses: tuple[PoseAccuracy, ...]
    distances: tuple[DistanceAccuracy, ...]
    largest: Mapping[str, float | None]
    _text: str = field(repr=False, compare=False)

    @property
    def text(self) -> str:
        """What the verb prints."""
        return self._text


def iso9283(run: File, *, point: str = "", pairs: str = "") -> Iso9283Report:
    """Judge a run that repeats the same poses in cycles (``measure(..., cycles=30)``).

    With three nests read at a pose the whole pose is judged, else the SMR's centre.

    Parameters
    ----------
    run : path
        The run.
    point : str
        Nest whose SMR is judged, in place of the platform's origin.
    pairs : str
        Pairs for the distances, ``"P2:P4,P1:P3"``; neighbours on the way if empty.

    Returns
    -------
    Iso9283Report

    Raises
    ------
    BadInput
        For a run without cycles, and labels that are not in it.

    Examples
    --------
    >>> pkmcal.iso9283("cycles/run").largest["RP_mm"]                        # doctest: +SKIP
    """
    loaded = read_run(Path(run))
    held = campaign(loaded.machine, loaded.run, point)
    results = [(pose, _judge(pose)) for pose in held.poses]
    distances = [
        (first.label, second.label, found)
        for first, second in _chosen_pairs(held, pairs)
        if (found := _distance(first, second)) is not None
    ]
    said = {
        "format": Iso9283Report.FORMAT,
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
    text = iso9283_words(loaded.machine.name, held, results, distances)
    return Iso9283Report.of(said, _text=text)


def _judge(pose: Attained) -> PoseResult:
    angles = None
    if pose.command_angles is not None and pose.attained_angles is not None:
        angles = (pose.command_angles, pose.attained_angles)
    return pose_result(pose.command, pose.attained, angles)


def _chosen_pairs(held: Campaign, pairs: str) -> list[tuple[Attained, Attained]]:
    if not pairs:
        return list(pairwise(held.poses))
    by_label = {pose.label: pose for pose in held.poses}
    chosen = []
    for pair in pairs.split(","):
        first, colon, second = pair.strip().partition(":")
        for label in (first, second):
            if not colon or label not in by_label:
                raise BadInput(
                    f'"{pair}" in the pairs',
                    remedy=f"Write P1:P2 with two of {', '.join(by_label)}.",
                )
        chosen.append((by_label[first], by_label[second]))
    return chosen


def _distance(first: Attained, second: Attained) -> DistanceResult | None:
    """Judge a pair over the cycles in which both were visited; None for fewer than two."""
    common = sorted(set(first.cycles) & set(second.cycles))
    if len(common) < 2:
        return None
    columns = [pose.attained[:, [pose.cycles.index(c) for c in common]] for pose in (first, second)]
    return distance_result((first.command, second.command), (columns[0], columns[1]))


def _pose_data(pose: Attained, found: PoseResult) -> dict[str, Any]:
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


def _distance_data(first: str, second: str, found: DistanceResult) -> dict[str, Any]:
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
