"""The model of a run: machine, effects and frames, and what it says that the tracker reads."""

from calib.model.prediction import Linearised, Model, State

__all__ = ["Linearised", "Model", "State"]
