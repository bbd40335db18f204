"""How programs and sheets write when something was: the form of a column of times."""

import re
from collections.abc import Sequence
from datetime import datetime

FORMS = ("s", "iso", "clock", "excel")
"""Forms with a name; others are patterns of strptime."""
EXCEL_DAYS = (30_000.0, 60_000.0)
"""Days since 1899-12-30: from 1982 to 2064."""
CLOSE_S = 0.02
"""Rows that would be so close, if their times were seconds, are days."""
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?( ?[AaPp][Mm])?")
_DATES = ("%d.%m.%Y", "%d.%m.%y", "%m/%d/%Y", "%d/%m/%Y", "%Y/%m/%d", "%d-%m-%Y", "%d %b %Y")
_TIMES = ("%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S,%f", "%I:%M:%S %p", "%H:%M", "%I:%M %p")


def form_of(texts: Sequence[str]) -> str | None:
    """The form in which all of some texts are times; None where they are none.

    A day and a month that can be either way round are taken as the first of the forms has them.
    """
    if all(_CLOCK.fullmatch(text) for text in texts):
        return "clock"
    if all(_is(text, "iso") for text in texts):
        return "iso"
    forms = [f"{date} {time}" for date in _DATES for time in _TIMES]
    return next((one for one in forms if all(_is(text, one) for text in texts)), None)


def either_way(form: str, texts: Sequence[str]) -> bool:
    """Whether day and month could be exchanged."""
    other = {"%m/%d/%Y": "%d/%m/%Y", "%d/%m/%Y": "%m/%d/%Y"}
    date, _, time = form.partition(" ")
    return date in other and all(_is(text, f"{other[date]} {time}") for text in texts)


def _is(text: str, form: str) -> bool:
    try:
        if form == "iso":
            datetime.fromisoformat(text.replace(",", "."))
        else:
            datetime.strptime(text, form)
    except ValueError:
        return False
    return True


def are_days(values: Sequence[float]) -> bool:
    """Whether numbers are Excel's dates: days since 1899-12-30, and not seconds."""
    if len(values) < 3 or not all(EXCEL_DAYS[0] < one < EXCEL_DAYS[1] for one in values):
        return False
    span = max(values) - min(values)
    return 0.0 < span < CLOSE_S * (len(values) - 1)
