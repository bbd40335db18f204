"""As found and as left: largest errors, axes, maps, and whether they keep a tolerance."""

from dataclasses import dataclass

import numpy as np

from app.report import figures
from app.report.page import Block, Items, Picture, Section, Table, Text, Verdict
from app.report.sources import Checked
from app.report.words import plain, with_uncertainty

FOUND, LEFT = "as found", "as left"
MDEG = 1e3
"""Answers hold degrees."""


@dataclass(frozen=True)
class Tolerance:
    """Largest errors that are allowed: norm of the position error, rotation angle; None: any."""

    um: float | None = None
    mdeg: float | None = None


@dataclass(frozen=True)
class Judged:
    """A quantity against its tolerance: the pose nearest to it, U of that, and the decision."""

    name: str
    unit: str
    largest: float
    expanded: float
    tolerance: float
    passed: bool
    open: bool
    """Not passed, but the largest error lies within its uncertainty of the tolerance."""


def judge_tolerance(checked: Checked, tolerance: Tolerance) -> tuple[Judged, ...]:
    """Guarded acceptance: a pose passes where its error and its U together keep the tolerance.

    Nothing is judged where no tolerance or no uncertainty is known.
    """
    expanded = checked.expanded()
    if expanded is None:
        return ()
    judged = []
    parts = (
        ("position", "µm", tolerance.um),
        ("orientation", "mdeg", tolerance.mdeg),
    )
    for (name, unit, limit), error, spread in zip(parts, checked.errors(), expanded, strict=True):
        if limit is None:
            continue
        worst = int(np.argmax(error + spread))
        passed = bool(np.all(error + spread <= limit))
        beyond = bool(np.any(error - spread > limit))
        judged.append(
            Judged(
                name, unit, float(error[worst]), float(spread[worst]), limit, passed,
                not passed and not beyond,
            )
        )  # fmt: skip
    return tuple(judged)


def result_blocks(
    before: Checked | None, after: Checked | None, tolerance: Tolerance
) -> tuple[Block, ...]:
    """The head of a record: the verdict, and one table of as found and as left."""
    last = after or before
    if last is None:
        said = "No verification stands in this record: how far off the machine is was not measured."
        return (Text(said),)
    named = LEFT if after else FOUND
    blocks: list[Block] = [*_verdict(last, named, tolerance), summary_table(before, after)]
    if tolerance.um is None and tolerance.mdeg is None:
        blocks.append(Text("No tolerance was agreed: conformity is not judged."))
    elif before is not None and after is not None:
        blocks += [Text(said) for said in _as_found(before, tolerance)]
    return tuple(blocks)


def _as_found(before: Checked, tolerance: Tolerance) -> list[str]:
    """What the machine was before anything was changed: it concerns all that was made with it."""
    judged = judge_tolerance(before, tolerance)
    if not judged:
        return []
    passed = all(one.passed for one in judged)
    told = ". ".join(_told(one) for one in judged)
    return [f"As found, by the same rule: {'PASS' if passed else 'FAIL'}. {told}."]


def _verdict(last: Checked, named: str, tolerance: Tolerance) -> list[Block]:
    judged = judge_tolerance(last, tolerance)
    if not judged:
        return []
    said = ". ".join(_told(one) for one in judged)
    passed = all(one.passed for one in judged)
    words = f"The machine {named}, at the {len(last.labels)} poses of the verification. {said}."
    return [Verdict("PASS" if passed else "FAIL", words)]


def _told(one: Judged) -> str:
    """A quantity at the pose that is nearest to its limit."""
    value, spread = with_uncertainty(one.largest, one.expanded)
    state = "within" if one.passed else ("not shown to be within" if one.open else "beyond")
    return (
        f"{one.name.capitalize()}: {value} ± {spread} {one.unit} at the pose nearest to the "
        f"limit, {state} {one.tolerance:g} {one.unit}"
    )


def summary_table(before: Checked | None, after: Checked | None) -> Table:
    """Largest and RMS errors with expanded uncertainties, and what noise alone would show."""
    rows: list[tuple[str, ...]] = []
    for name, checked in ((FOUND, before), (LEFT, after)):
        if checked is not None:
            rows.append((name, str(len(checked.labels)), *_summary(checked)))
    last = after or before
    assert last is not None
    noise = last.answer["noise_alone"]
    rows.append(
        (
            "a perfect machine would show", str(len(last.labels)),
            f"{noise['position_peak_um']:.1f}", "",
            f"{MDEG * noise['orientation_peak_deg']:.1f}", "",
        )
    )  # fmt: skip
    heads = (
        "", "poses", "largest position error, µm", "RMS, µm",
        "largest orientation error, mdeg", "RMS, mdeg",
    )  # fmt: skip
    return Table(
        heads,
        tuple(rows),
        "Norm of the position error of the platform's origin and rotation angle of its "
        "orientation, each ± U (k = 2).",
    )


def _summary(checked: Checked) -> tuple[str, ...]:
    seen, spread = checked.answer["measured"], checked.answer.get("expanded") or {}
    cells = []
    for key, scale in (
        ("position_peak_um", 1.0), ("position_rms_um", 1.0),
        ("orientation_peak_deg", MDEG), ("orientation_rms_deg", MDEG),
    ):  # fmt: skip
        expanded = spread.get(key)
        if expanded is None:
            cells.append(f"{scale * seen[key]:.1f}")
        else:
            cells.append(" ± ".join(with_uncertainty(scale * seen[key], scale * expanded)))
    return tuple(cells)


def accuracy_section(
    before: Checked | None, after: Checked | None, tolerance: Tolerance
) -> Section:
    """Errors in detail: along each axis, pose by pose, over the workspace."""
    last = after or before
    if last is None:
        return Section("Accuracy of the machine", (Text("Not measured."),))
    low, high = last.positions().min(axis=1), last.positions().max(axis=1)
    box = ", ".join(
        f"{axis} {plain(f'{a:.1f}')} to {plain(f'{b:.1f}')}"
        for axis, a, b in zip("xyz", low, high, strict=True)
    )
    series = [
        (name, checked.labels, *checked.errors())
        for name, checked in ((FOUND, before), (LEFT, after))
        if checked is not None
    ]
    blocks: list[Block] = [
        Text(
            f"{_counts(before, after)} that were not used in any fit ({box} mm, base frame). "
            "Errors lead from the wanted pose to the measured one, in the axes of the base frame; "
            "they hold the noise of the tracker."
        ),
        _axes_table(before, after),
        Picture.of(
            figures.errors_by_pose(series, (tolerance.um, tolerance.mdeg)),
            "Error of every pose: norm of the position error and rotation angle. Where two "
            "verifications are shown, the same pose stands at the same place."
            + (" Dashed: tolerance." if tolerance.um or tolerance.mdeg else ""),
        ),
    ]
    maps = [(name, one) for name, one in ((FOUND, before), (LEFT, after)) if one is not None]
    blocks.append(
        Picture.of(
            figures.workspace_maps([(n, one.positions(), one.errors()[0]) for n, one in maps]),
            "Where in the workspace the error sits: at each place the largest position error of "
            "its orientations, µm. Each row has a scale of its own.",
        )
    )
    return Section("Accuracy of the machine", tuple(blocks))


def _counts(before: Checked | None, after: Checked | None) -> str:
    """How many poses were visited: ``216 poses as found, 27 as left``."""
    counts = [
        (name, len(one.labels)) for name, one in ((FOUND, before), (LEFT, after)) if one is not None
    ]
    if len({count for _, count in counts}) == 1:
        return f"{counts[0][1]} poses"
    return ", ".join(
        f"{count} poses {name}" if k == 0 else f"{count} {name}"
        for k, (name, count) in enumerate(counts)
    )


def _axes_table(before: Checked | None, after: Checked | None) -> Table:
    rows = []
    for name, checked in ((FOUND, before), (LEFT, after)):
        for one in () if checked is None else checked.answer.get("axes", ()):
            scale = 1.0 if one["unit"] == "um" else MDEG
            mean = f"{scale * one['mean']:.1f}"
            if one["u_mean"] is not None:
                mean = " ± ".join(with_uncertainty(scale * one["mean"], scale * one["u_mean"]))
            rows.append(
                (
                    f"{one['axis']}, {'µm' if one['unit'] == 'um' else 'mdeg'}", name, plain(mean),
                    plain(f"{scale * one['std']:.1f}"), plain(f"{scale * one['largest']:+.1f}"),
                )
            )  # fmt: skip
    rows.sort(key=lambda row: list("xyzr").index(row[0][0]) + ("xyz".find(row[0][1]) + 1))
    heads = ("axis", "", "mean ± U", "standard deviation", "largest")
    return Table(heads, tuple(rows), "Deviations along and about each base axis.", words=(1,))


def pose_table(before: Checked | None, after: Checked | None) -> Section:
    """Every value of every verification pose."""
    blocks: list[Block] = []
    for name, checked in ((FOUND, before), (LEFT, after)):
        if checked is not None:
            blocks.append(_every_pose(name, checked))
    return Section("All verification poses", tuple(blocks) or (Items(()),))


def _every_pose(name: str, checked: Checked) -> Table:
    spread = checked.expanded()
    rows = []
    for k, row in enumerate(checked.answer["errors"]):
        place = checked.poses[row["pose"]]
        turned = np.rad2deg(place[3:])
        rows.append(
            (
                row["pose"],
                *(plain(f"{v:.1f}") for v in place[:3]),
                *(plain(f"{v:.1f}") for v in turned),
                *(plain(f"{v:.1f}") for v in row["position_um"]),
                "" if spread is None else f"{spread[0][k]:.1f}",
                *(plain(f"{MDEG * v:.1f}") for v in row["rotation_deg"]),
                "" if spread is None else f"{spread[1][k]:.1f}",
            )
        )
    heads = (
        "pose", "x, mm", "y", "z", "rx, deg", "ry", "rz",
        "dx, µm", "dy", "dz", "U", "drx, mdeg", "dry", "drz", "U",
    )  # fmt: skip
    return Table(heads, tuple(rows), f"{name.capitalize()}; U (k = 2) in the worst direction.")
