"""What a diagnosis says to the operator: one sentence on what to do next."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib.discover.agreement import (
    TOGETHER_WORSE,
    loose_references,
    runs_at_odds,
    untrue_uncertainties,
)
from calib.discover.carrier import axes_of, motion_words
from calib.discover.diagnosis import RunDiagnosis
from calib.discover.impossible import chance_words, forbidden_best
from calib.discover.likeness import likeness_of, likeness_words
from calib.discover.noise_report import noise_words
from calib.discover.problem import TIMES_Q
from calib.evidence.family import p_of, significant
from calib.evidence.findings import Diagnosis
from calib.evidence.forward import WEAK, hints
from calib.identify.fitting import Fit
from calib.identify.starting import MOVED
from calib.runs.remark import Remark

FEW_POSES = 15


def hinted_at(found: RunDiagnosis, impossible: Sequence[str] = ()) -> tuple[str, ...]:
    """Effects that might be there besides."""
    return hints(found.diagnosis, [effect.id for effect in found.fit.model.effects], impossible)


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
    excluded = f" {_readings(bad)} excluded." if bad else ""
    if any(reading.why.endswith(MOVED) for reading in found.fit.bad):
        excluded += " Many of these moved as one: make a run of its own of them."
    poses = _poses(found.fit)
    if poses < FEW_POSES:
        named = "one pose" if poses == 1 else f"{poses} poses"
        excluded += f" With {named} only large effects would show: measure more."
    told = noise_words(found.fit, found.noise_or)
    kinds = {one.name for one in found.fit.components_of_noise}
    scatter = "" if told and "scale" not in kinds else untrue_uncertainties(found.fit)
    if scatter and kinds <= {"scale"}:
        told = ""  # it is the same in other words
    if told:
        excluded = f" As to noise: {told}.{excluded}"
    hinted = hinted_at(found, impossible)
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
            clearly = " clearly" if found.noise_or else ""
            says = f"Nothing else is{clearly} missing:{excluded}"
            return says + (f" {loose}." if loose else "")
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
        held = [effect.id for effect in found.fit.model.effects]
        depends, weak = _depends(found), _by_chance(diagnosis)
        perhaps, seems = (" perhaps", "may be") if weak else ("", "is")
        so_far = f"{named}: named, but{perhaps} not the whole story. " if named else ""
        return (
            f"{so_far}Something {seems} missing that no known effect explains; {depends}{weak}."
            f"{likeness_words(likeness, depends, held)}{excluded}"
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


def _by_chance(diagnosis: Diagnosis) -> str:
    """How often chance leaves as much, where it may have."""
    log_p = diagnosis.unexplained.log_p
    return "" if significant(log_p, WEAK) else f" (p = {p_of(log_p):.1g}: chance does so, too)"


def _depends(found: RunDiagnosis) -> str:
    """On what the unexplained rest depends, strongest first."""
    strongest = found.diagnosis.unexplained.dependences[:1]
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
    moved = motion_words(strongest[0], axes_of(found.fit))
    return f"it is periodic in time, with a period of {length}{moved}"


def _readings(count: int) -> str:
    return "One reading is" if count == 1 else f"{count} readings are"
