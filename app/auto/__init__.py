"""A laboratory that decides by itself: measure, find what is missing, stop when it is enough."""

from app.auto.policy import Decision, Known, Limits, decide

__all__ = ["Decision", "Known", "Limits", "decide"]
