"""One account of a run: how it is read, what is said of it, and the fit that judges it."""

from collections.abc import Mapping
from dataclasses import dataclass

from calib.arrays import Array
from calib.identify.fitting import Fit
from calib.runs.record import Run
from calib.runs.remark import Remark


@dataclass(frozen=True, eq=False)
class Story:
    """A run as it is meant, or its parts with frames of their own.

    ``known``: effects that the record shows. ``fit``: that of this account, where there is one yet.
    """

    parts: list[Run]
    remarks: list[Remark]
    known: Mapping[str, Array]
    fit: Fit | None = None
