"""Maximum-likelihood identification in the space of the readings, and what it is worth."""

from calib.identify.fitting import Fit, fit
from calib.identify.holdout import HoldOut, hold_out
from calib.identify.readings import BadReading
from calib.identify.report import fit_report, unidentified_groups, unidentified_words

__all__ = [
    "BadReading",
    "Fit",
    "HoldOut",
    "fit",
    "fit_report",
    "hold_out",
    "unidentified_groups",
    "unidentified_words",
]
