"""The history of the machines of a lab: what happened, what changed, where it drifts."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from app.files.machines import load_machine
from app.history.store import Entry, History
from app.jobs.chosen_runs import File
from app.jobs.record import Record, Report
from app.jobs.remembering import remember_verifications
from calib.errors import BadInput
from calib.trend import Drift, change, drift

DAY_S = 86400.0
MONTH_S = 30.4375 * DAY_S
SPAN_S = DAY_S
"""Time that calibrations must lie apart before a drift is told of them: what an afternoon says of
a month is noise, multiplied."""


@dataclass(frozen=True, kw_only=True)
class EventEntry(Record):
    """Something that happened: ``kind`` is applied, fit or verification; ``source`` names it."""

    utc: str
    kind: str
    source: str
    says: str


@dataclass(frozen=True, kw_only=True)
class DriftEntry(Record):
    """A line through a series: ``rate`` per month with its sigma, family-wise p-value.

    ``clear``: more than chance. ``months``: from the last value until the line leaves what is
    allowed; None if never, or nothing is known of that.
    """

    rate: float
    sigma: float
    p_value: float
    clear: bool
    months: float | None


@dataclass(frozen=True, kw_only=True)
class SeriesEntry(Record):
    """A parameter over the calibrations: moments, values and sigmas in ``unit``.

    ``change`` of the last against the one before, with its sigma and family-wise p-value;
    ``changed``: more than chance. None where there is but one.
    """

    name: str
    unit: str
    utc: tuple[str, ...]
    values: tuple[float, ...]
    sigmas: tuple[float, ...]
    change: float | None
    change_sigma: float | None
    p_value: float | None
    changed: bool
    drift: DriftEntry | None


@dataclass(frozen=True, kw_only=True)
class MachineEntry(Record):
    """One machine: its events, parameters, and ``errors``, the largest position error in um."""

    machine: str
    serial: str
    events: tuple[EventEntry, ...]
    parameters: tuple[SeriesEntry, ...]
    errors: SeriesEntry | None


@dataclass(frozen=True, kw_only=True)
class HistoryReport(Report):
    """What became of the machines whose sessions lie in a folder (``pkm-history/1``)."""

    FORMAT: ClassVar[str] = "pkm-history/1"
    machines: tuple[MachineEntry, ...]


def history_of(
    folder: File = "sessions", *, serial: str = "", tolerance_um: float | None = None
) -> HistoryReport:
    """Read the history of a folder; verifications that are not in it yet are judged and entered.

    Parameters
    ----------
    folder : path
        Where the sessions are.
    serial : str
        Only the machine with this controller.
    tolerance_um : float, optional
        For the forecast: largest position error that is allowed.

    Returns
    -------
    HistoryReport

    Raises
    ------
    BadInput
        If the database cannot be read.

    Examples
    --------
    >>> pkmcal.history_of(tolerance_um=25.0).machines[0].errors              # doctest: +SKIP
    """
    root = Path(folder)
    remember_verifications(root)
    by_machine: dict[tuple[str, str], list[Entry]] = {}
    for entry in History(root).entries():
        if not serial or entry.serial == serial:
            by_machine.setdefault((entry.machine, entry.serial), []).append(entry)
    machines = [
        _machine(name, number, entries, tolerance_um)
        for (name, number), entries in by_machine.items()
    ]
    return HistoryReport.of({"format": HistoryReport.FORMAT, "machines": machines})


def _machine(
    name: str, serial: str, entries: Sequence[Entry], tolerance_um: float | None
) -> dict[str, Any]:
    fits = _last_fits(entries)
    series: dict[str, list[tuple[Entry, Mapping[str, Any]]]] = {}
    for entry in fits:
        for one in entry.said["parameters"]:
            series.setdefault(one["name"], []).append((entry, one))
    allowed = _allowed(name)
    return {
        "machine": name,
        "serial": serial,
        "events": [
            {"utc": e.utc, "kind": e.kind, "source": e.source, "says": _says(e)} for e in entries
        ],
        "parameters": [
            _series(
                parameter,
                str(points[0][1]["unit"]),
                [(e.when.timestamp(), e.utc, one["value"], one["sigma"]) for e, one in points],
                allowed.get(parameter),
                len(series),
            )
            for parameter, points in series.items()
        ],
        "errors": _errors(entries, tolerance_um),
    }


def _last_fits(entries: Sequence[Entry]) -> list[Entry]:
    """Of each set of runs the fit that was made last, in the order in which they were measured.

    A fit of several runs together is none beside fits of some of them: what they share would pass
    for two calibrations that agree.
    """
    last: dict[tuple[str, ...], Entry] = {}
    for entry in entries:
        if entry.kind == "fit":
            last[tuple(entry.said["runs"])] = entry
    seen: set[str] = set()
    alone = []
    for runs, entry in sorted(last.items(), key=lambda item: len(item[0])):
        if seen.isdisjoint(runs):
            seen.update(runs)
            alone.append(entry)
    return sorted(alone, key=lambda entry: entry.utc)


def _allowed(machine: str) -> dict[str, tuple[float, float]]:
    """Ranges of the parameters by the tolerances of the machine's file, where it is at hand."""
    try:
        known = load_machine(machine).parameters
    except BadInput:
        return {}
    return {p.name: (p.nominal - p.tolerance, p.nominal + p.tolerance) for p in known}


def _series(
    name: str,
    unit: str,
    points: Sequence[tuple[float, str, float, float]],
    allowed: tuple[float, float] | None,
    among: int,
) -> dict[str, Any]:
    last = None
    if len(points) > 1:
        last = change(points[-2][2:], points[-1][2:], among)
    months = [(when - points[-1][0]) / MONTH_S for when, *_ in points]
    line = None
    if points[-1][0] - min(when for when, *_ in points) >= SPAN_S:
        line = drift(months, [p[2] for p in points], [p[3] for p in points], among)
    return {
        "name": name,
        "unit": unit,
        "utc": [p[1] for p in points],
        "values": [p[2] for p in points],
        "sigmas": [p[3] for p in points],
        "change": last and last.value,
        "change_sigma": last and last.sigma,
        "p_value": last and last.p_value,
        "changed": last is not None and last.clear,
        "drift": None if line is None else _drift(line, allowed),
    }


def _drift(line: Drift, allowed: tuple[float, float] | None) -> dict[str, Any]:
    months = math.inf if allowed is None else line.reaches(*allowed)
    return {
        "rate": line.rate,
        "sigma": line.sigma,
        "p_value": line.p_value,
        "clear": line.clear,
        "months": months if line.clear and math.isfinite(months) else None,
    }


def _errors(entries: Sequence[Entry], tolerance_um: float | None) -> dict[str, Any] | None:
    """Largest position error since the last set was applied, as verified."""
    applied = max((e.utc for e in entries if e.kind == "applied"), default="")
    seen = [e for e in entries if e.kind == "verification" and e.utc > applied]
    if not seen:
        return None
    points = [
        (
            e.when.timestamp(), e.utc, e.said["measured"]["position_peak_um"],
            e.said["expanded"]["position_peak_um"] / e.said["expanded"]["k"],
        )
        for e in seen
    ]  # fmt: skip
    allowed = None if tolerance_um is None else (0.0, tolerance_um)
    return _series("largest position error", "um", points, allowed, 1)


def _says(entry: Entry) -> str:
    said = entry.said
    if entry.kind == "applied":
        return f"set {said['set']}, checksum {said['checksum']:#010x}, from {entry.source}"
    if entry.kind == "fit":
        effects = f" with {', '.join(said['effects'])}" if said["effects"] else ""
        return f"RMS {said['rms_um']:.1f} um{effects}"
    seen = said["measured"]
    return (
        f"largest {seen['position_peak_um']:.1f} um, {1e3 * seen['orientation_peak_deg']:.1f} mdeg "
        f"at {said['poses']} poses"
    )
