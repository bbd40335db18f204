"""Procedures and return codes of GeoCOM that are used here, by the names of Leica's manual."""

from enum import IntEnum


class Rpc(IntEnum):
    """Remote procedures."""

    COM_NULLPROC = 0
    TMC_DO_MEASURE = 2008
    TMC_GET_FACE = 2026
    TMC_GET_SIMPLE_MEA = 2108
    CSV_GET_INSTRUMENT_NO = 5003
    CSV_GET_INSTRUMENT_NAME = 5004
    CSV_GET_SW_VERSION = 5034
    MOT_STOP_CONTROLLER = 6002
    AUT_MAKE_POSITIONING = 9027
    AUT_CHANGE_FACE = 9028
    AUT_SEARCH = 9029
    AUT_FINE_ADJUST = 9037
    BAP_SET_PRISM_TYPE = 17008
    AUS_SET_USER_ATR_STATE = 18005


class Rc(IntEnum):
    """Return codes that are told apart; every other one that is not zero is a refusal."""

    OK = 0
    ABORT = 8
    TMC_NO_FULL_CORRECTION = 1283
    TMC_ACCURACY_GUARANTEE = 1284
    TMC_ANGLE_OK = 1285
    TMC_ANGLE_NO_FULL_CORRECTION = 1288
    TMC_ANGLE_ACCURACY_GUARANTEE = 1289
    TMC_ANGLE_ERROR = 1290
    TMC_DIST_PPM = 1291
    TMC_DIST_ERROR = 1292
    TMC_BUSY = 1293
    TMC_SIGNAL_ERROR = 1294
    COM_PROC_UNAVAIL = 3081
    AUT_TIMEOUT = 8704
    AUT_NO_TARGET = 8710
    AUT_MULTIPLE_TARGETS = 8711


NOT_YET = frozenset({Rc.TMC_ANGLE_OK, Rc.TMC_BUSY, Rc.TMC_ANGLE_NO_FULL_CORRECTION,
                     Rc.TMC_ANGLE_ACCURACY_GUARANTEE})  # fmt: skip
"""Codes that say that the angles are there and the distance is not."""
LOST = frozenset({Rc.TMC_DIST_ERROR, Rc.TMC_SIGNAL_ERROR, Rc.AUT_NO_TARGET,
                  Rc.AUT_MULTIPLE_TARGETS, Rc.AUT_TIMEOUT, Rc.ABORT})  # fmt: skip
"""Codes that say that there is no reading."""
WHOLE = frozenset({Rc.OK, Rc.TMC_NO_FULL_CORRECTION, Rc.TMC_ACCURACY_GUARANTEE})
"""Codes with which a distance is there; all but the first are a warning."""
PRISMS = {"round": 0, "mini": 1, "tape": 2, "360": 3, "mini-360": 7, "mini-zero": 8}
"""Types of prism by their names in a site file."""


def in_words(code: int) -> str:
    """A return code for the operator."""
    known = {one.value: one.name for one in Rc}
    return f"{known[code]} ({code})" if code in known else f"return code {code}"
