"""The report of a calibration: what was off, what was found, what is left.

It is made anew from files that anyone can read again: the run, and the verifications before and
after. Nothing in it is kept elsewhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.report import figures
from app.report.page import Page, Picture, Section, Table
from calib.arrays import Array
from calib.identify import Fit

_PLOTTED = 60
"""Parameters in one figure; more go to the table only."""


@dataclass(frozen=True)
class Checked:
    """A verification (``pkm-verification/1``) with the poses that it visited, label -> pose."""

    answer: Mapping[str, Any]
    poses: Mapping[str, tuple[float, ...]]

    def errors(self) -> tuple[Array, Array]:
        """Norms of position error (mm) and rotation angle (deg) of every pose, (N,) each."""
        rows = self.answer["errors"]
        position = np.linalg.norm([row["position_um"] for row in rows], axis=1) / 1e3
        return position, np.linalg.norm([row["rotation_deg"] for row in rows], axis=1)

    def positions(self) -> Array:
        """Commanded platform positions (3, N) in mm, in the order of :meth:`errors`."""
        return np.array([self.poses[row["pose"]][:3] for row in self.answer["errors"]]).T


def calibration_page(
    title: str,
    fit: Fit,
    answer: Mapping[str, Any],
    before: Checked | None = None,
    after: Checked | None = None,
    made_by: str = "",
) -> Page:
    """The whole report; ``answer`` is the ``pkm-fit/1`` of ``fit``."""
    sections = []
    if after is not None:
        sections.append(_verification(before, after))
    sections.append(_fit(fit, answer))
    sections.append(_parameters(fit, answer))
    sections.append(_drift(fit))
    machine = fit.model.rows.machine
    lead = f"Machine {machine.name}: {machine.says}."
    return Page(title, lead, tuple(sections), made_by)


def _verification(before: Checked | None, after: Checked) -> Section:
    named = [("before", before), ("after", after)]
    series = [(name, *checked.errors()) for name, checked in named if checked is not None]
    paper = after.answer["paper"]
    pictures = [
        Picture.of(
            figures.errors_by_pose(
                series, (paper["position_peak_um"] / 1e3, paper["orientation_peak_deg"])
            ),
            "Error of each verification pose as the tracker sees it: norm of the position error "
            "and rotation angle. Dashed: peak that Han et al. 2020 measured after calibration.",
        )
    ]
    if before is not None and len(before.errors()[0]) == len(after.errors()[0]):
        pictures.append(
            Picture.of(
                figures.workspace_map(after.positions(), before.errors()[0], after.errors()[0]),
                "Where in the workspace the error sits: the largest of the orientations at each "
                "node, in um. Before and after have scales of their own.",
            )
        )
    low, high = after.positions().min(axis=1), after.positions().max(axis=1)
    box = ", ".join(f"{axis} {a:.1f}..{b:.1f}" for axis, a, b in zip("xyz", low, high, strict=True))
    return Section(
        "Error of the machine, before and after",
        f"{len(after.answer['errors'])} poses that were not used in the fit ({box} mm). Measured: "
        "as the tracker sees them, its own noise included; what that noise alone would show "
        "stands below.",
        (_verification_table(before, after),),
        tuple(pictures),
    )


def _verification_table(before: Checked | None, after: Checked) -> Table:
    rows: list[tuple[str, ...]] = []
    for key, name in (("measured", "measured"), ("truth", "noise-free truth of the mock")):
        for when, checked in (("before", before), ("after", after)):
            if checked is not None and checked.answer.get(key):
                rows.append((f"{name}, {when}", *_summary(checked.answer[key])))
    noise, paper = after.answer["noise_alone"], after.answer["paper"]
    for name, peaks in (("tracker noise alone", noise), ("Han et al. 2020, after", paper)):
        rows.append(
            (
                name,
                f"{peaks['position_peak_um']:.1f}",
                "",
                f"{peaks['orientation_peak_deg']:.4f}",
                "",
            )
        )
    heads = ("", "position peak, um", "std, um", "orientation peak, deg", "std, deg")
    return Table(heads, tuple(rows))


def _summary(found: Mapping[str, float]) -> tuple[str, ...]:
    return (
        f"{found['position_peak_um']:.1f}",
        f"{found['position_std_um']:.1f}",
        f"{found['orientation_peak_deg']:.4f}",
        f"{found['orientation_std_deg']:.4f}",
    )


def _fit(fit: Fit, answer: Mapping[str, Any]) -> Section:
    rows = (
        ("fitted readings", _um(answer["rms_um"]), _um(answer["noise_floor_um"])),
        ("held-out poses", _um(answer["holdout_rms_um"]), _um(answer["holdout_floor_um"])),
    )
    residual = np.linalg.norm(fit.linear.residual[:, fit.accepted], axis=0) * 1e3
    effects = ", ".join(answer["effects"]) or "none beside the geometry"
    bad = [(str(b["line"]), b["why"]) for b in answer["bad_readings"]]
    tables = [Table(("", "RMS, um", "a perfect model, um"), rows)]
    if bad:
        tables.append(Table(("line", "excluded because"), tuple(bad)))
    return Section(
        "The fit",
        f"{answer['readings']} readings, {len(answer['parameters'])} unknowns, physical effects: "
        f"{effects}. Chi-square per degree of freedom {answer['chi2_per_dof']:.3f}.",
        tuple(tables),
        (
            Picture.of(
                figures.residual_cloud(residual, float(answer["noise_floor_um"])),
                "Distance between measured and predicted SMR centre, in the order of measuring.",
            ),
        ),
    )


def _um(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _parameters(fit: Fit, answer: Mapping[str, Any]) -> Section:
    machine = fit.model.rows.machine
    found = {row["name"]: row for row in answer["parameters"]}
    pictures = []
    for unit in ("mm", "rad"):
        known = [p for p in machine.parameters if p.unit == unit and p.name in found][:_PLOTTED]
        if known:
            rows = [found[p.name] for p in known]
            pictures.append(
                Picture.of(
                    figures.parameter_changes(
                        [p.name for p in known],
                        np.array([r["value"] - r["nominal"] for r in rows]),
                        np.array([r["sigma"] for r in rows]),
                        np.array([p.tolerance for p in known]),
                        unit,
                    ),
                    "Identified minus nominal, with one standard uncertainty, over the "
                    "manufacturing tolerance.",
                )
            )
    return Section(
        "Parameters",
        _unidentified(answer["unidentified"]),
        (_parameter_table(answer),),
        tuple(pictures),
    )


def _unidentified(groups: Sequence[Sequence[str]]) -> str:
    """What the readings leave open, in words."""
    alone = [group[0] for group in groups if len(group) == 1]
    said = []
    if alone:
        said.append(
            f"{', '.join(alone)}: not seen by these readings; they stay near the drawing's values, "
            "and what they leave uncertain is in the stated uncertainties."
        )
    said += [f"Of {', '.join(g)} only a combination is known." for g in groups if len(g) > 1]
    return " ".join(said) or "All parameters are identified."


def _parameter_table(answer: Mapping[str, Any]) -> Table:
    rows = tuple(
        (
            row["name"],
            f"{row['value']:.6g}" if row["nominal"] is None else f"{row['value']:.4f}",
            f"{row['sigma']:.2g}",
            "" if row["nominal"] is None else f"{row['value'] - row['nominal']:+.4f}",
            row["unit"],
            "yes" if row["identified"] else "no",
        )
        for row in answer["parameters"]
    )
    heads = ("parameter", "value", "1 sigma", "change", "unit", "identified")
    return Table(heads, rows, folded=f"All {len(rows)} values")


def _drift(fit: Fit) -> Section:
    rows = fit.model.rows
    times: dict[str, Array] = {}
    shifts: dict[str, Array] = {}
    for run in rows.runs:
        for nest in run.header.base_nests:
            at = [k for k, name in enumerate(run.nest) if name == nest and run.measured[k]]
            if len(at) > 1:
                seen = run.position[:, at]
                times[nest] = run.time_s[at]
                shifts[nest] = np.linalg.norm(seen - seen[:, :1], axis=0)
    if not times:
        return Section("Drift", "No base nest was read twice: drift was not watched.")
    worst = max(float(s.max()) for s in shifts.values()) * 1e3
    return Section(
        "Drift",
        f"Base nests moved at most {worst:.1f} um from their first reading.",
        (),
        (
            Picture.of(
                figures.drift(times, shifts), "Distance of each base nest from its first reading."
            ),
        ),
    )
