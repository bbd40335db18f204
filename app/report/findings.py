"""What was found: the fit, effects with their sizes, the way to them, all parameters, stability."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from app.files.staircase import Way
from app.report import figures
from app.report.instruments import by_tracker
from app.report.page import Block, Items, Picture, Section, Table, Text
from app.report.words import plain, with_uncertainty
from app.show.record_words import excluded_lines
from calib.arrays import Array
from calib.discover.report import effect_parameters
from calib.identify import Fit
from calib.identify.reach import Reach

COVERAGE = 2.0
_PLOTTED = 60
"""Parameters in one figure; more go to the table only."""


def fit_section(
    fit: Fit, answer: Mapping[str, Any], remarks: Sequence[Mapping[str, Any]]
) -> Section:
    """How well the model describes the readings; what is to be said of the record of the run."""
    rows = (
        ("fitted readings", _um(answer["rms_um"]), _um(answer["noise_floor_um"])),
        (
            "poses held out of the fit",
            _um(answer["holdout_rms_um"]),
            _um(answer["holdout_floor_um"]),
        ),
    )
    residual = np.linalg.norm(fit.linear.residual[:, fit.accepted], axis=0) * 1e3
    shown = "Difference of each reading from its prediction"
    if by_tracker(fit):
        shown = "Distance between measured and predicted reflector centre"
    blocks: list[Block] = [
        Text(
            f"{answer['readings']} readings, {len(answer['parameters'])} unknowns. Chi-square per "
            f"degree of freedom {_number(answer['chi2_per_dof'], 3)}; 1 is what the stated "
            "uncertainties of the readings lead one to expect."
        ),
        Table(("distance measured to predicted", "RMS, µm", "a perfect model leaves, µm"), rows),
        Picture.of(
            figures.residual_cloud(residual, float(answer["noise_floor_um"])),
            f"{shown}, in the order of measuring.",
        ),
    ]
    blocks += [
        Text(f"Remark on the readings: {one['says']}. {one['evidence']}. {one['done']}.")
        for one in remarks
    ]
    bad = excluded_lines(answer)
    if bad:
        blocks += [Text("Readings that are not in the fit:"), Items(tuple(bad))]
    return Section("Identification", tuple(blocks))


def effects_section(
    fit: Fit, reach: Mapping[str, Reach], way: Way, kept: Mapping[str, str]
) -> Section:
    """Effects beside the geometry: sizes, what each moves, the way to them, what stays open.

    ``kept`` says of each effect what became of it when the parameters were written.
    """
    effects = [effect.id for effect in fit.model.effects]
    if not effects:
        return Section(
            "Effects beside the geometry", (Text("None was called for by the readings."),)
        )
    sizes = [
        (
            one["name"],
            *with_uncertainty(one["value"], COVERAGE * one["sigma"]),
            one["unit"],
        )
        for one in effect_parameters(fit)
    ]
    moved = [
        (
            name,
            f"{reach[name].rms_um:.1f}" if name in reach else "–",
            f"{reach[name].largest_um:.1f}" if name in reach else "–",
            kept.get(name, ""),
        )
        for name in effects
    ]
    what = "reflector" if by_tracker(fit) else "nests"
    heads = ("effect", f"moves the {what}, RMS µm", "at most, µm", "")
    blocks: list[Block] = [
        Table(heads, tuple(moved), "Over the readings of the platform.", words=(3,)),
        Table(
            ("size", "value", "U (k = 2)", "unit"),
            tuple(sizes),
            "Of many alike only those that differ from zero.",
            words=(3,),
        ),
        *_way_blocks(way, effects),
    ]
    return Section("Effects beside the geometry", tuple(blocks))


def _way_blocks(way: Way, effects: Sequence[str]) -> list[Block]:
    """The staircase, and what could not be told apart."""
    blocks: list[Block] = []
    if len(way.steps) > 1:
        heads = ("step", "RMS, µm", "perfect", "held out, µm", "perfect", "chi²/dof", "p")
        rows = tuple(
            (
                step.did, _um(step.rms_um), _um(step.noise_floor_um), _um(step.holdout_rms_um),
                _um(step.holdout_floor_um), _number(step.chi2_per_dof, 2), _chance(step.p_value),
            )
            for step in way.steps
        )  # fmt: skip
        blocks.append(
            Table(
                heads,
                rows,
                "How the model was found, one step after the other. p: the chance that readings "
                "without the effect would call for any as strongly.",
            )
        )
        if all(step.rms_um is not None for step in way.steps):
            blocks.append(Picture.of(*staircase_figure(way)))
    rivals: dict[str, dict[str, None]] = {}
    for first, *others in way.not_told_apart:
        if first in effects and others:
            rivals.setdefault(first, {}).update(dict.fromkeys(others))
    said = [
        f"{name} was found; these readings cannot tell it from {_or(list(others))}."
        for name, others in rivals.items()
    ]
    if said:
        blocks.append(Items(tuple(said)))
    return blocks


def staircase_figure(way: Way) -> tuple[Any, str]:
    """The staircase as a figure, and the words below it."""

    def column(name: str) -> Array:
        return np.array([getattr(step, name) or np.nan for step in way.steps], dtype=float)

    series = [("fitted", column("rms_um"), column("noise_floor_um"))]
    held = column("holdout_rms_um")
    if np.isfinite(held).all():
        series.append(("held out", held, column("holdout_floor_um")))
    words = "RMS of the residual with each step; dashed: what a perfect model would leave."
    return figures.staircase([step.did for step in way.steps], series), words


def parameters_section(fit: Fit, answer: Mapping[str, Any]) -> Section:
    """All that was identified, with what the readings leave open."""
    machine = fit.model.rows.machine
    found = {row["name"]: row for row in answer["parameters"]}
    blocks: list[Block] = []
    open_ = _left_open(answer["unidentified"])
    if open_:
        blocks.append(
            Text(
                "The readings do not determine all of it; what they leave uncertain is in the "
                "stated uncertainties:"
            )
        )
        blocks.append(Items(open_))
    for unit in ("mm", "rad"):
        known = [p for p in machine.parameters if p.unit == unit and p.name in found][:_PLOTTED]
        if known:
            rows = [found[p.name] for p in known]
            blocks.append(
                Picture.of(
                    figures.parameter_changes(
                        [p.name for p in known],
                        np.array([r["value"] - r["nominal"] for r in rows]),
                        COVERAGE * np.array([r["sigma"] for r in rows]),
                        np.array([p.tolerance for p in known]),
                        unit,
                    ),
                    "Identified minus nominal with U (k = 2), over the manufacturing tolerance.",
                )
            )
    blocks.append(_parameter_table(answer))
    return Section("All identified values", tuple(blocks))


def _left_open(groups: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """What the readings leave open, those that stand alone in one sentence."""
    alone = [group[0] for group in groups if len(group) == 1]
    said = [f"Only a combination is known of {_and(group)}." for group in groups if len(group) > 1]
    if alone:
        stay = (
            "it stays near its drawing value" if len(alone) == 1 else "they stay near the drawing"
        )
        said.insert(0, f"Not seen by these readings: {_and(alone)}; {stay}.")
    return tuple(said)


def _parameter_table(answer: Mapping[str, Any]) -> Table:
    rows = []
    for row in answer["parameters"]:
        expanded = COVERAGE * row["sigma"]
        value, spread = with_uncertainty(row["value"], expanded)
        change = ""
        if row["nominal"] is not None:
            change = with_uncertainty(row["value"] - row["nominal"], expanded)[0]
        named = row["name"] if row["identified"] else f"{row['name']} *"
        rows.append((named, value, spread, change, row["unit"]))
    heads = ("parameter", "value", "U (k = 2)", "minus nominal", "unit")
    return Table(
        heads, tuple(rows), "* not determined by these readings: near its drawing.", words=(4,)
    )


def drift_section(fit: Fit, limit_um: float | None) -> Section:
    """How far the base nests moved while each run was taken."""
    runs = fit.model.rows.runs
    series: dict[str, tuple[Array, Array]] = {}
    worst: dict[int, float] = {}
    for number, run in enumerate(runs, start=1):
        for nest in run.header.base_nests:
            at = [k for k, name in enumerate(run.nest) if name == nest and run.measured[k]]
            if len(at) < 2:
                continue
            seen = run.position[:, at]
            shift = 1e3 * np.linalg.norm(seen - seen[:, :1], axis=0)
            name = f"run {number}, {nest}" if len(runs) > 1 else f"nest {nest}"
            series[name] = (run.time_s[at], shift)
            worst[number] = max(worst.get(number, 0.0), float(shift.max()))
    if not series:
        said = "No base nest was read twice: drift was not watched."
        if not by_tracker(fit):
            said = "The base was not read: what drifts shows in readings that are repeated alone."
        return Section("Stability", (Text(said),))
    if len(runs) == 1:
        said = f"Base nests moved at most {worst[1]:.1f} µm from their first reading."
    else:
        each = ", ".join(f"{moved:.1f} µm in run {number}" for number, moved in worst.items())
        said = f"Base nests moved, from their first reading in each run, at most: {each}."
    return Section(
        "Stability",
        (
            Text(said),
            Picture.of(
                figures.drift(series, limit_um),
                "Distance of each base nest from its first reading of the run."
                + (" Dashed: limit." if limit_um is not None else ""),
            ),
        ),
    )


def _or(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def _and(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _um(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _number(value: float | None, digits: int) -> str:
    return "–" if value is None else f"{value:.{digits}f}"


def _chance(p: float | None) -> str:
    return "" if p is None else plain(f"{p:.1g}")
