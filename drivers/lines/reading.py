"""What stands in a line: a pattern with a name for each number."""

import math
import re
from dataclasses import dataclass

from drivers.lines.patience import LONGEST, slow_on
from drivers.plausible import SIGMA_MM, SURVEYED_MM

UNITS = {"mm": 1.0, "um": 1e-3, "m": 1e3, "in": 25.4}
"""mm in one unit."""
NUMBER = r"[+-]?(?:\d{1,40}(?:\.\d{0,40})?|\.\d{1,40})(?:[eE][+-]?\d{1,4})?"
_BETWEEN = r"(?:\s*[,;]\s*|\s+)"
PLAIN = rf"\s*(?P<x>{NUMBER}){_BETWEEN}(?P<y>{NUMBER}){_BETWEEN}(?P<z>{NUMBER})\b.*"
"""Three numbers at the beginning, apart by blanks, commas or semicolons."""


def fault_in(pattern: str) -> str:
    """What is wrong with a pattern, in words; "" if nothing."""
    try:
        compiled = re.compile(pattern)
    except re.error as error:
        return f"no pattern: {error}"
    missing = [name for name in "xyz" if name not in compiled.groupindex]
    if missing:
        return f"no group (?P<{missing[0]}>...)"
    return slow_on(compiled)


@dataclass(frozen=True)
class Reading:
    """A line that was read: SMR centre in mm, its own sigmas in mm if it has them."""

    xyz: tuple[float, float, float]
    sigma: tuple[float, float, float] | None


class LinePattern:
    """Lines of one instrument.

    Parameters
    ----------
    pattern : str
        With groups x, y, z; sx, sy, sz if a line has uncertainties.
    unit : str
        Of these numbers, one of :data:`UNITS`.
    decimal : str
        Sign before decimals.
    ignore : str
        Lines in which this is found say nothing; "" for none.
    """

    def __init__(self, pattern: str, unit: str, decimal: str, ignore: str) -> None:
        self._pattern = re.compile(pattern)
        self._own_sigma = all(name in self._pattern.groupindex for name in ("sx", "sy", "sz"))
        self._factor = UNITS[unit]
        self._decimal = decimal
        self._ignore = re.compile(ignore) if ignore else None

    def ignores(self, line: str) -> bool:
        """Whether a line says nothing."""
        return not line.strip() or bool(self._ignore and self._ignore.search(line[:LONGEST]))

    def read(self, line: str) -> Reading | None:
        """The reading in a line; None where there is none, as when the SMR is out of the beam."""
        found = self._pattern.fullmatch(line) if len(line) <= LONGEST else None
        if found is None:
            return None
        values = [self._number(found[name]) for name in "xyz"]
        sigma = [self._number(found[f"s{name}"]) for name in "xyz"] if self._own_sigma else None
        if not all(abs(value) <= SURVEYED_MM for value in values):
            return None
        if sigma is not None and not all(SIGMA_MM[0] <= one <= SIGMA_MM[1] for one in sigma):
            return None
        x, y, z = values
        return Reading((x, y, z), None if sigma is None else (sigma[0], sigma[1], sigma[2]))

    def _number(self, text: str | None) -> float:
        try:
            return self._factor * float((text or "").replace(self._decimal, "."))
        except ValueError:
            return math.nan
