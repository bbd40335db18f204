"""Sessions: a plan run on a station, with a journal. See :mod:`app.session.session`."""

from app.session.plan import Plan, Step
from app.session.plans import PlanOptions, measure_plan, pose_labels
from app.session.session import Outcome, Session
from app.session.station import Station

__all__ = [
    "Outcome",
    "Plan",
    "PlanOptions",
    "Session",
    "Station",
    "Step",
    "measure_plan",
    "pose_labels",
]
