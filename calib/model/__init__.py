"""The model of a run: machine, effects and frames, and what it says that the tracker reads."""

from calib.model.prediction import Model
from calib.model.state import Linearised, State

__all__ = ["Linearised", "Model", "State"]
