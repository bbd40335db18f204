"""What diagnosis and discovery say: ``pkm-diagnosis/1`` and ``pkm-discovery/1``, and in words."""

from collections.abc import Sequence
from statistics import NormalDist
from typing import Any

import numpy as np

from calib.discover.agreement import (
    TOGETHER_WORSE,
    loose_references,
    runs_at_odds,
    untrue_uncertainties,
)
from calib.discover.carrier import carriers, motion_words
from calib.discover.diagnosis import RunDiagnosis
from calib.discover.discovery import stage_of
from calib.discover.impossible import chance_words, forbidden_best, impossible_entry
from calib.discover.likeness import likeness_of, likeness_of_found, likeness_words
from calib.discover.noise_report import noise_report, noise_words
from calib.discover.problem import TIMES_Q
from calib.effects import not_defined
from calib.evidence.findings import Diagnosis, Finding
from calib.evidence.forward import WEAK, Discovery, hints
from calib.identify.fitting import Fit
from calib.identify.report import bad_readings, quality, um
from calib.identify.starting import MOVED
from calib.look.judged import judged, record_of, settled
from calib.runs.remark import Remark, plain_remarks
from calib.unknown import Estimate, estimates_of, linear_among

FEW_POSES = 15


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
        "indistinguishable": [list(group) for group in diagnosis.indistinguishable],
        "unexplained": _unexplained(diagnosis),
        "likeness": likeness_of(diagnosis) if diagnosis.best is None else None,
        "noise": noise_report(found.fit),
        "bad_readings": bad_readings(found.fit),
        "unavailable": found.unavailable,
        "not_on_this_machine": not_defined(found.fit.model.machine),
        "advice": advice(found, record),
    }


def discovery_report(discovery: Discovery) -> dict[str, Any]:
    """Answer of ``pkmcal discover --json``."""
    last = stage_of(discovery).run
    record = record_of(last.fit)
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
        "unexplained": _unexplained(last.diagnosis),
        "likeness": likeness_of_found(discovery),
        "noise": noise_report(last.fit),
        "bad_readings": bad_readings(last.fit),
        "parameters": effect_parameters(last.fit),
        "refused": [name for name in discovery.refused if name not in discovery.impossible],
        "unavailable": last.unavailable,
        "impossible": [impossible_entry(last, name) for name in discovery.impossible],
        "advice": advice(
            last, record, discovery.refused, likeness_of_found(discovery), discovery.impossible
        ),
    }


def _hinted(found: RunDiagnosis, impossible: Sequence[str] = ()) -> tuple[str, ...]:
    return hints(found.diagnosis, [effect.id for effect in found.fit.model.effects], impossible)


def _verdict(
    found: RunDiagnosis, record: Sequence[Remark], impossible: Sequence[str] = ()
) -> dict[str, Any]:
    """Whether the model will do: nothing is called for but hints, and the record is sound."""
    named = _hinted(found, impossible)
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
    last = discovery.last.diagnosis.indistinguishable
    return list(dict.fromkeys((*discovery.indistinguishable, *last)))


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


def _unexplained(diagnosis: Diagnosis) -> dict[str, Any]:
    unexplained = diagnosis.unexplained
    periods = {d.channel: d.period for d in unexplained.dependences if d.period is not None}
    return {
        "significant": unexplained.significant,
        "channels": list(unexplained.channels),
        **({"periods": periods} if periods else {}),
        "carriers": carriers(unexplained.dependences),
    }


def advice(
    found: RunDiagnosis,
    record: Sequence[Remark] = (),
    refused: Sequence[str] = (),
    likeness: dict[str, Any] | None = None,
    impossible: Sequence[str] = (),
) -> str:
    """One sentence for the operator: what to do next; ``refused`` by the held-out poses.

    ``impossible``: refused for a value that physics forbids.

    What is wrong with the record comes before all physics.
    """
    first = [one for one in record if not one.settled]
    if first and not runs_at_odds(found.fit):
        return f"{first[0].says}. {first[0].remedy}; then ask again."
    alike = likeness or (likeness_of(found.diagnosis) if found.diagnosis.best is None else None)
    return _of_physics(found, refused, alike, impossible)


def _of_physics(
    found: RunDiagnosis,
    refused: Sequence[str],
    likeness: dict[str, Any] | None,
    impossible: Sequence[str],
) -> str:
    diagnosis = found.diagnosis
    bad = len(found.fit.bad)
    excluded = f" {_readings(bad)} excluded: see bad_readings." if bad else ""
    if any(reading.why.endswith(MOVED) for reading in found.fit.bad):
        excluded += " Many of these moved as one: make a run of its own of them."
    poses = _poses(found.fit)
    if poses < FEW_POSES:
        named = "one pose" if poses == 1 else f"{poses} poses"
        excluded += f" With {named} only large effects would show: measure more."
    told = noise_words(found.fit)
    kinds = {one.name for one in found.fit.components_of_noise}
    scatter = "" if told and "scale" not in kinds else untrue_uncertainties(found.fit)
    if scatter and kinds <= {"scale"}:
        told = ""  # it is the same in other words
    if told:
        excluded = f" As to noise: {told}.{excluded}"
    hinted = _hinted(found, impossible)
    forbidden = tuple(impossible) or forbidden_best(found)
    if forbidden and set(hinted) <= set(impossible):
        return f"{chance_words(found, forbidden)}{excluded}"
    if hinted := tuple(name for name in hinted if name not in impossible):
        return (
            f"Nothing else is clearly missing. {' and '.join(hinted)} might be there too, but one "
            f"run in twenty looks so by chance: pkmcal design --discriminate {hinted[0]} nothing "
            f"plans the readings that decide.{excluded}"
        )
    if diagnosis.adequate:
        if scatter:
            return (
                f"Nothing is missing that these readings show. {scatter}: correct them.{excluded}"
            )
        if told:
            excluded = excluded.removeprefix(" As to noise:")
            loose = loose_references(found.fit)
            return f"Nothing else is missing:{excluded}" + (f" {loose}." if loose else "")
        if loose := loose_references(found.fit):
            return f"Nothing is missing that these readings show. {loose}.{excluded}"
        return f"Nothing is missing: the model explains the readings to their noise.{excluded}"
    best = diagnosis.best
    odds = runs_at_odds(found.fit)
    if odds and (best is None or found.outlook(best).rms_mm > TOGETHER_WORSE * odds.apart_mm):
        return f"{odds}.{excluded}"
    if best is None and found.fit.chi2_per_dof < 1.0 and scatter:
        excluded = f" {scatter}: correct them first.{excluded}"
    if best is None:
        named = ", ".join(effect.id for effect in found.fit.model.effects)
        so_far = f"{named}: named, but not the whole story. " if named else ""
        return (
            f"{so_far}Something is missing that no known effect explains; "
            f"{_depends(diagnosis)}.{likeness_words(likeness, _depends(diagnosis))}{excluded}"
        )
    if best.name in refused:
        return (
            f"{best.name} is called for (p = {best.p_value:.2g}), but held-out poses would be "
            "predicted worse with it, so it was not added. More poses decide: pkmcal design "
            f"--discriminate {best.name} nothing.{excluded}"
        )
    outlook = found.outlook(best)
    says = found.columns_of(best.name).effect.says
    before, after = found.holdout.rms_mm, outlook.holdout.rms_mm
    does = "falls" if after < before else "would not fall: it goes"
    text = (
        f"Add {best.name} ({says}): the error on held-out poses {does} from "
        f"{1000 * before:.1f} to {1000 * after:.1f} um"
    )
    # A group of another effect is about a model that has this one already.
    own = [group for group in diagnosis.indistinguishable if group[0] == best.name]
    rivals = [name for group in own for name in group]
    others = [name for name in rivals if name != best.name]
    if others:
        text += (
            f"; this run cannot tell it from {', '.join(others)}: pkmcal design --discriminate "
            f"{best.name} {others[0]} plans the readings that can"
        )
    return f"{text}.{excluded}"


def _poses(fit: Fit) -> int:
    """How many poses were read; those without a label are told apart by where they are."""
    rows = fit.model.rows
    on = np.flatnonzero(rows.on_platform)
    return len({rows.pose_name[k] or tuple(rows.q[:, k].round(4).tolist()) for k in on})


def _depends(diagnosis: Diagnosis) -> str:
    """On what the unexplained rest depends, strongest first."""
    strongest = diagnosis.unexplained.dependences[:1]
    if not strongest:
        return "on what it depends does not show"
    channel, period = strongest[0].channel, strongest[0].period
    if channel == "pose":
        return "it depends on the pose"
    if strongest[0].carrier.endswith(TIMES_Q):
        return f"it depends on {channel} times q, as if the actuators' gain changed with it"
    if period is None:
        return f"it depends on {channel}"
    if channel != "time_s":
        return f"it depends on {channel} with a period of {period:.3g}"
    length = f"{period / 60:.3g} min" if period >= 120 else f"{period:.4g} s"
    return f"it is periodic in time, with a period of {length}{motion_words(strongest[0])}"


def _readings(count: int) -> str:
    return "One reading is" if count == 1 else f"{count} readings are"
