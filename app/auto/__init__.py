"""A laboratory that decides by itself: measure, find what is missing, stop when it is enough."""

from app.auto.decision import Creep, Decision, Known, Limits
from app.auto.policy import decide

__all__ = ["Creep", "Decision", "Known", "Limits", "decide"]
