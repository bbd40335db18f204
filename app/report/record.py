"""The calibration record: its sections in their order."""

from collections.abc import Mapping, Sequence
from typing import Any

from app.files.record_details import RecordDetails
from app.files.staircase import Way
from app.report.accuracy import Tolerance, accuracy_section, pose_table, result_blocks
from app.report.findings import drift_section, effects_section, fit_section, parameters_section
from app.report.items import (
    conditions_section,
    head_facts,
    instruments_section,
    method_section,
    statements_section,
)
from app.report.page import Page, Section
from app.report.sources import Sources
from app.report.written import kept_words, written_section, written_values
from calib.identify import Fit
from calib.identify.reach import reach_of_effects
from calib.look.judged import record_of
from calib.runs.remark import plain_remarks


def record_page(
    fit: Fit,
    answer: Mapping[str, Any],
    sources: Sources,
    *,
    tolerance: Tolerance,
    way: Way,
    title: str,
    number: str,
    issued: str,
    made_by: str,
) -> Page:
    """The whole record; ``answer`` is the ``pkm-fit/1`` of ``fit``."""
    details = sources.site.record if sources.site is not None else RecordDetails()
    machine = fit.model.rows.machine
    serial = details.machine_serial or fit.model.rows.runs[-1].header.controller_serial
    reach = reach_of_effects(fit)
    effects = {effect.id: effect.kind for effect in fit.model.effects}
    limit = None if sources.site is None else 1e3 * sources.site.limits.drift_mm
    before, after = sources.before, sources.after
    sections: Sequence[Section] = (
        Section("Result", result_blocks(before, after, tolerance)),
        instruments_section(details, sources, fit),
        conditions_section(sources),
        method_section(sources, fit, answer, details, tolerance),
        accuracy_section(before, after, tolerance),
        written_section(sources.applied, effects, reach),
        effects_section(fit, reach, way, kept_words(sources.applied, effects)),
        fit_section(fit, answer, plain_remarks(record_of(fit))),
        drift_section(fit, limit),
        statements_section(details, sources),
    )
    appendices = [parameters_section(fit, answer)]
    if sources.applied is not None:
        appendices.append(written_values(sources.applied))
    if before or after:
        appendices.append(pose_table(before, after))
    return Page(
        title=title,
        number=number,
        issued=issued,
        laboratory=details.laboratory.strip(),
        head=head_facts(
            details,
            sources,
            f"{machine.name}: {machine.says}" if machine.says else machine.name,
            serial,
        ),
        sections=tuple(sections),
        appendices=tuple(appendices),
        signatures=("Calibrated by", "Approved by"),
        footer=made_by,
        logo=details.logo,
    )
