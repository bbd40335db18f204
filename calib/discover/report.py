"""What diagnosis and discovery say: ``pkm-diagnosis/1`` and ``pkm-discovery/1``, and in words."""

from collections.abc import Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from calib.discover.advice import advice, hinted_at
from calib.discover.carrier import axes_of, carriers
from calib.discover.diagnosis import RunDiagnosis
from calib.discover.discovery import stage_of
from calib.discover.drifting import drift_or_step
from calib.discover.impossible import impossible_entry
from calib.discover.likeness import likeness_of, likeness_of_found
from calib.discover.noise_report import noise_report
from calib.effects import not_defined
from calib.evidence.family import p_of
from calib.evidence.findings import Diagnosis, Finding
from calib.evidence.forward import WEAK, Discovery
from calib.identify.fitting import Fit
from calib.identify.report import bad_readings, quality, um
from calib.look.judged import judged, record_of, settled
from calib.runs.remark import Remark, plain_remarks
from calib.unknown import Estimate, estimates_of, linear_among


def diagnosis_report(found: RunDiagnosis) -> dict[str, Any]:
    """Answer of ``pkmcal diagnose --json``."""
    diagnosis = found.diagnosis
    record = _record(found)
    return {
        "format": "pkm-diagnosis/1",
        "baseline": {
            "effects": [effect.id for effect in found.fit.model.effects],
            **_quality(found),
        },
        **_verdict(found, record),
        "record": plain_remarks(record),
        "candidates": [_candidate(found, finding) for finding in diagnosis.findings],
        "indistinguishable": [list(group) for group in _in_question(diagnosis)],
        "unexplained": _unexplained(found),
        "likeness": likeness_of(diagnosis) if diagnosis.best is None else None,
        "noise": noise_report(found.fit, found.noise_or),
        "bad_readings": bad_readings(found.fit),
        "unavailable": found.unavailable,
        "not_on_this_machine": not_defined(found.fit.model.machine),
        "advice": advice(found, record),
    }


def discovery_report(discovery: Discovery) -> dict[str, Any]:
    """Answer of ``pkmcal discover --json``."""
    last = stage_of(discovery).run
    record = drift_or_step(record_of(last.fit), discovery)
    return {
        "format": "pkm-discovery/1",
        "steps": [
            {
                "added": step.added,
                **({"removed": step.removed} if step.removed else {}),
                **_called_for(discovery, number),
                **_quality(stage_of(discovery, number).run),
            }
            for number, step in enumerate(discovery.steps)
        ],
        "effects": list(discovery.last.effects),
        **_verdict(last, record, discovery.impossible),
        "record": plain_remarks(record),
        "indistinguishable": [list(group) for group in _groups(discovery)],
        "unexplained": _unexplained(last),
        "likeness": likeness_of_found(discovery),
        "noise": noise_report(last.fit, last.noise_or),
        "bad_readings": bad_readings(last.fit),
        "parameters": effect_parameters(last.fit),
        "refused": [name for name in discovery.refused if name not in discovery.impossible],
        "unavailable": last.unavailable,
        "not_on_this_machine": not_defined(last.fit.model.machine),
        "impossible": [impossible_entry(last, name) for name in discovery.impossible],
        "advice": advice(
            last, record, discovery.refused, likeness_of_found(discovery), discovery.impossible
        ),
    }


def _verdict(
    found: RunDiagnosis, record: Sequence[Remark], impossible: Sequence[str] = ()
) -> dict[str, Any]:
    """Whether the model will do: nothing is called for but hints, and the record is sound."""
    named = hinted_at(found, impossible)
    return {
        "adequate": (found.diagnosis.adequate or bool(named)) and settled(record),
        "hints": [
            {"effect": one.name, "p_value": one.p_value}
            for one in found.diagnosis.findings
            if one.name in named and one.name not in impossible
        ],
    }


def _record(found: RunDiagnosis) -> tuple[Remark, ...]:
    """What is said first: the effect that would be added is judged like those in the model."""
    best = found.diagnosis.best
    if best is None:
        return record_of(found.fit)
    effect = found.columns_of(best.name).effect
    offered = judged(effect, found.outlook(best).estimates, found.fit)
    return (*record_of(found.fit), *offered)


def _called_for(discovery: Discovery, number: int) -> dict[str, Any]:
    """p-value, evidence and rivals of an effect when it was added.

    Empty for one that the record itself shows: it was in the model before any was asked for.
    """
    added = discovery.steps[number].added
    if added is None or added in stage_of(discovery, number).fit.model.rows.known:
        return {}
    return called_for(stage_of(discovery, number - 1).run, added)


def called_for(found: RunDiagnosis, added: str) -> dict[str, Any]:
    """``p_value``, ``log_evidence``, ``weak`` and ``rivals`` of an effect, by the model before it.

    Empty where the effect was no candidate.
    """
    before = found.diagnosis
    finding = next((one for one in before.findings if one.name == added), None)
    if finding is None:
        return {}
    rivals = [name for group in before.indistinguishable if group[0] == added for name in group]
    return {
        "p_value": finding.p_value,
        "log_evidence": finding.log_evidence,
        "weak": finding.p_value > WEAK,
        "rivals": [name for name in rivals if name != added],
    }


def _groups(discovery: Discovery) -> list[tuple[str, ...]]:
    last = _in_question(discovery.last.diagnosis)
    return list(dict.fromkeys((*discovery.indistinguishable, *last)))


def _in_question(diagnosis: Diagnosis) -> tuple[tuple[str, ...], ...]:
    """Groups of effects of which one is called for: none where it is something unknown."""
    return () if diagnosis.unknown_preferred else diagnosis.indistinguishable


def _quality(found: RunDiagnosis) -> dict[str, float | None]:
    return {
        **quality(found.fit),
        "holdout_rms_um": um(found.holdout.rms_mm),
        "holdout_floor_um": um(found.holdout.floor_mm),
    }


def _candidate(found: RunDiagnosis, finding: Finding) -> dict[str, Any]:
    outlook = found.outlook(finding)
    return {
        "effect": finding.name,
        "p_value": finding.p_value,
        "rms_after_um": um(outlook.rms_mm),
        "holdout_rms_after_um": um(outlook.holdout.rms_mm),
        "visible": finding.visible,
        "parameters": _significant(outlook.estimates, finding.acting),
    }


def effect_parameters(fit: Fit) -> list[dict[str, Any]]:
    """Unknowns of the effects in a model, those that are significant among many of a kind."""
    listed: list[dict[str, Any]] = []
    at = fit.model.free.size
    for group in fit.model.unknowns:
        here = slice(at, at + len(group))
        at += len(group)
        listed += _significant(estimates_of(group, fit.values[here], fit.sigmas[here]))
    return listed


def _significant(estimates: Sequence[Estimate], acting: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Entries of the unknowns that differ from zero; of all if none does or there is but one.

    Several linear unknowns of a kind share 5 %; nonlinear ones are always listed.
    """
    linear = linear_among(estimate.unknown for estimate in estimates)
    limit = -NormalDist().inv_cdf(0.025 / max(1, int(linear.sum())))
    clear = np.array([abs(one.value) > limit * one.sigma for one in estimates])
    if linear.sum() == 1 or not np.any(clear & linear):
        chosen = np.array([estimate.name in acting for estimate in estimates])
        shown = linear & (chosen | ~np.any(chosen))
    else:
        shown = clear & linear
    shown = shown | ~linear
    return [
        {
            "name": estimate.name,
            "value": estimate.value,
            "sigma": estimate.sigma,
            "unit": estimate.unit,
            **estimate.unknown.in_words(estimate.value),
        }
        for estimate, show in zip(estimates, shown, strict=True)
        if show
    ]


def _unexplained(found: RunDiagnosis) -> dict[str, Any]:
    unexplained = found.diagnosis.unexplained
    periods = {d.channel: d.period for d in unexplained.dependences if d.period is not None}
    return {
        "significant": unexplained.significant,
        "channels": list(unexplained.channels),
        **({"periods": periods} if periods else {}),
        "carriers": carriers(unexplained.dependences, axes_of(found.fit)),
        "p_value": p_of(unexplained.log_p),
    }
