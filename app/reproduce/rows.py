"""A number of a paper beside ours, with a verdict."""

from collections.abc import Sequence
from dataclasses import dataclass

from calib.errors import BadInput

REACHED, BETTER, NOT_REACHABLE = "reached", "better", "not reachable"


@dataclass(frozen=True)
class Row:
    """One or several numbers that belong together.

    ``because`` says why theirs cannot be reached, or what a reader must know about ours.
    """

    where: str
    what: str
    theirs: str
    ours: str
    unit: str
    verdict: str
    because: str = ""


def show(value: float | str | Sequence[float]) -> str:
    """Numbers as they stand in the page."""
    if isinstance(value, str):
        return value
    if isinstance(value, (int, float)):
        return f"{value:.6g}"
    return ", ".join(f"{v:.6g}" for v in value)


def compare(
    where: str,
    what: str,
    theirs: float | Sequence[float],
    ours: float | Sequence[float],
    unit: str,
    *,
    within: float | Sequence[float] = 0.0,
    relative: float = 0.0,
    smaller_is_better: bool = False,
    because: str = "",
    note: str = "",
) -> Row:
    """Judge our numbers by theirs.

    Parameters
    ----------
    within : float, or one for each number
        Largest difference that counts as reached, in the unit.
    relative : float
        The same as a part of theirs.
    smaller_is_better : bool
        For errors: ours being smaller counts as better.
    because : str
        Why theirs cannot be reached, should ours differ.
    note : str
        Said whatever the verdict.

    Raises
    ------
    BadInput
        If a number is not reached and no reason is given: no row may be left unexplained.
    """
    few = _list(theirs)
    slack = [within] * len(few) if isinstance(within, (int, float)) else list(within)
    pairs = list(zip(few, _list(ours), slack, strict=True))
    text = (show(theirs), show(ours), unit)
    if all(abs(t - o) <= w + relative * abs(t) for t, o, w in pairs):
        return Row(where, what, *text, REACHED, note)
    if smaller_is_better and all(abs(o) <= abs(t) + w for t, o, w in pairs):
        return Row(where, what, *text, BETTER, note)
    if not because:
        raise BadInput(
            f"{where}, {what}: ours {text[1]} {unit}, theirs {text[0]}",
            remedy="The reproduction has changed: find out why before the page is written.",
        )
    return Row(where, what, *text, NOT_REACHABLE, because)


def unreachable(
    where: str, what: str, theirs: float | str | Sequence[float], unit: str, because: str,
    ours: float | str | Sequence[float] = "-",
) -> Row:  # fmt: skip
    """A number that nobody can reach from what is printed."""
    return Row(where, what, show(theirs), show(ours), unit, NOT_REACHABLE, because)


def _list(value: float | Sequence[float]) -> list[float]:
    return [float(value)] if isinstance(value, (int, float)) else [float(v) for v in value]
