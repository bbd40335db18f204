"""A step of the frame that the record shows, where a slow drift would look so, too.

Where readings wander, the best step explains most of it, and the first look, which knows white
noise alone, takes it. A step that is one is called for against noise that wanders as well.
"""

from collections.abc import Sequence
from dataclasses import replace

from calib.discover.discovery import RunStage, stage_of
from calib.evidence.forward import Discovery
from calib.runs.remark import Remark

STEP, MOVED = "frame-shift", "station-moved"


def passes_for_a_step(beside: RunStage, alone: RunStage) -> bool:
    """Whether a step of the frame is called for only as long as noise is white.

    ``beside`` has it in the model, ``alone`` has not; both take the same readings.
    """
    if not beside.run.fit.noise.tau_s > 0.0:
        return False
    same = beside.fit.accepted.tolist() == alone.fit.accepted.tolist()
    return same and STEP not in alone.diagnosis.explained_by


def drift_or_step(record: Sequence[Remark], discovery: Discovery) -> tuple[Remark, ...]:
    """The record, with what is said of a station that moved left open where it may have drifted."""
    names = [step.added for step in discovery.steps]
    if STEP not in names or not any(one.name == MOVED for one in record):
        return tuple(record)
    alone, beside = stage_of(discovery, 0), stage_of(discovery, names.index(STEP))
    if not passes_for_a_step(beside, alone):
        return tuple(record)
    return tuple(_open(one) if one.name == MOVED else one for one in record)


def _open(remark: Remark) -> Remark:
    return replace(
        remark,
        says=f"{remark.says}; or it drifts slowly, which looks so, too",
        evidence=f"{remark.evidence}; beside noise that wanders no step is called for",
        remedy="See how the tracker and the base stand, and read the base nests more often: they "
        "tell a drift from a move",
        settled=False,
    )
