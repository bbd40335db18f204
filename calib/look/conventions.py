"""How numbers were written: units, handedness, order and signs, tried where a run fits nowhere.

Readings that stand nowhere near their nests are tried in every other way in which people write
them. What brings most of them to their places is named; nothing is mended, as there may be more
than one way to the same places.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.look.command_ways import of_commands
from calib.look.order import sorted_column
from calib.look.places import Places, places_of
from calib.look.way import Way, of_angles, of_one_axis
from calib.mechanism.description import Machine
from calib.runs.record import Run

NOWHERE = 0.8
"""Part of the readings up to which a run that nothing else explains is tried in other ways."""
ENOUGH = 0.8
"""Part of the readings that must stand in their nests for a way of writing to be named."""
MOST_READINGS = 40
"""Readings with which ways are tried."""
LEAST_READINGS = 6
LEAST_PAIRS = 3
"""Distances between nests that tell a unit."""
STRETCH = 0.05
"""How far from a unit's factor distances may be."""
_LENGTHS = ((1000.0, "m"), (25.4, "inches"), (0.001, "um"), (10.0, "cm"), (304.8, "feet"))


class Misread(BadInput):
    """Numbers that are written in another way than the file says; ``of`` is which ones."""

    def __init__(self, what: str, *, of: str, place: str = "", remedy: str = "") -> None:
        self.of = of
        super().__init__(what, place=place, remedy=remedy)


def check_lengths(machine: Machine, run: Run) -> None:
    """Refuse readings or nests in another unit of length: distances between nests tell it alone.

    Raises
    ------
    Misread
        Naming the unit.
    """
    base = _stretch(run, run.header.base_nests, None)
    platform = _stretch(run, run.header.platform_nests, run.pose)
    known = [one for one in (base, platform) if one]
    odd = next((one for one in known if not _is(one, 1.0)), None)
    if odd is None:
        return
    stretched = dict(_stretching(run, both=len(known) == 2))
    found = [
        way
        for way, (of_base, of_platform) in stretched.items()
        if (not base or _is(base, of_base)) and (not platform or _is(platform, of_platform))
    ]
    if not found:
        return
    way = found[0] if len(found) == 1 else _best(machine, iter(found), 0)[0] or found[0]
    raise Misread(
        f"{way.says}: distances between nests are read {float(np.median(odd)):.4g} times as long "
        "as they are stated",
        of=way.of,
        place=run.source,
        remedy=way.remedy,
    )


def _stretching(run: Run, *, both: bool) -> Iterator[tuple[Way, tuple[float, float]]]:
    """Ways of writing lengths, and how many times too long distances on base and platform are."""
    for (factor, _), way in zip(_LENGTHS, _of_positions(run), strict=False):
        yield way, (1.0 / factor, 1.0 / factor)
    kinds = ((1, 1), (0, 1), (1, 0)) if both else ((1, 1),)
    for number, way in enumerate(_of_nests(run)):
        factor = _LENGTHS[number // 3][0]
        for kind in kinds:
            if kind == ((1, 1), (0, 1), (1, 0))[number % 3]:
                yield way, (factor ** kind[0], factor ** kind[1])


def _stretch(run: Run, nests: Mapping[str, Array], place: Sequence[str] | None) -> list[float]:
    """Read over stated distances of nests that were read at one place, by the label of the pose."""
    last: dict[tuple[str, str], Array] = {}
    found = []
    for row in np.flatnonzero(run.measured):
        name = run.nest[row]
        if name not in nests:
            continue
        at = "" if place is None else place[int(row)]
        last[(at, name)] = run.position[:, row]
        for other, stands in nests.items():
            stated = float(np.linalg.norm(nests[name] - stands))
            if other != name and stated > 0.0 and (at, other) in last:
                read = float(np.linalg.norm(run.position[:, row] - last[(at, other)]))
                found.append(read / stated)
    return found if len(found) >= LEAST_PAIRS else []


def _is(ratios: Sequence[float], factor: float) -> bool:
    """Whether distances are ``factor`` times as long as stated, most of them."""
    near = np.abs(np.array(ratios) / factor - 1.0) < STRETCH
    return bool(ratios) and float(np.mean(near)) > 0.5


def check_conventions(machine: Machine, given: Run, places: Places | None, than: int = 0) -> None:
    """Refuse a run that stands nowhere, and stands in its places if it is read in another way.

    Parameters
    ----------
    machine : Machine
    given : Run
    places : Places, optional
        Where its readings stand as it is written; None where the machine cannot even close.
    than : int
        How many readings another hypothesis explains already; with one, only other ways of
        writing positions are tried.

    Raises
    ------
    Misread
        Saying which way that is, and how many readings it explains.
    """
    now = 0 if places is None else places.strict.standing
    count = given.readings
    if now >= NOWHERE * count:
        return
    _check_sorted(given)
    run = _thinned(given)
    few = int(run.measured.sum())
    more = 0 if places is None else max(now, than) + places.limit
    least = int(np.ceil(max(ENOUGH * few, more * few / count, LEAST_READINGS)))
    tried = _of_points(run) if than else ways(machine, run)
    best, most = _best(machine, _likely(given, tried), least)
    if best is None and not than:
        best, most = _best(machine, _likely(given, _two_ways(run)), least)
    if best is None:
        return
    raise Misread(
        f"{best.says}: so {most} of {few} readings stand in their nests, as it is written "
        f"{now} of {count} do",
        of=best.of,
        place=run.source,
        remedy=best.remedy,
    )


def _check_sorted(run: Run) -> None:
    """Refuse a column that was sorted by itself: the readings stand nowhere."""
    name = sorted_column(run)
    if name:
        raise Misread(
            f"column {name} is sorted by itself: it never falls from row to row, and the readings "
            "stand in no nest",
            of="position",
            place=run.source,
            remedy="Take the file as it was measured; sort whole rows, or none",
        )


def _likely(run: Run, tried: Iterator[Way]) -> Iterator[Way]:
    """Ways without those of a unit of length, where the distances between nests are right as read.

    Nests that are all in one point fit many readings of a machine that has wide tolerances.
    """
    known = [_stretch(run, run.header.platform_nests, run.pose)]
    known.append(_stretch(run, run.header.base_nests, None))
    right = [one for one in known if one and _is(one, 1.0)]
    return (way for way in tried if not (way.resized and right))


def _thinned(run: Run) -> Run:
    """The run with so few of its readings, evenly spread, that many ways can be tried."""
    read = np.flatnonzero(run.measured)
    if read.size <= MOST_READINGS:
        return run
    kept = np.zeros_like(run.measured)
    kept[read[np.linspace(0, read.size - 1, MOST_READINGS).astype(np.intp)]] = True
    return replace(run, measured=kept)


def _best(machine: Machine, tried: Iterator[Way], least: int) -> tuple[Way | None, int]:
    """The way that brings most readings to their nests, and how many; the first of equals."""
    best: Way | None = None
    most = least - 1
    for way in tried:
        places = places_of(machine, way.run)
        if places is None:
            continue
        count = places.strict.standing
        if count > most:
            best, most = way, count
            if count == places.rows.count:
                break
    return best, most


def ways(machine: Machine, run: Run) -> Iterator[Way]:
    """Every single way in which a run may have been written, the likeliest first."""
    yield from _of_points(run)
    yield from _of_nests(run)
    yield from of_commands(machine, run)


def _of_points(run: Run) -> Iterator[Way]:
    yield from _of_positions(run)
    yield from of_angles(run)
    yield from of_one_axis(run)


def _of_positions(run: Run) -> Iterator[Way]:
    for factor, unit in _LENGTHS:
        yield Way(
            "position",
            f"x, y, z look like {unit}, not mm",
            f"Write x, y, z in mm (these numbers times {factor:g}), and their sigmas too",
            replace(run, position=factor * run.position),
            resized=True,
        )
    flip = np.array([[1.0], [1.0], [-1.0]])
    yield Way(
        "position",
        "x, y, z are left-handed: two of the axes are exchanged, or one has the wrong sign",
        "Exchange two of the columns x, y, z, or turn one sign round: see in which frame the "
        "instrument's program wrote them",
        replace(run, position=flip * run.position),
    )


def _of_nests(run: Run) -> Iterator[Way]:
    header = run.header
    for factor, unit in _LENGTHS:
        platform = {name: factor * at for name, at in header.platform_nests.items()}
        base = {name: factor * at for name, at in header.base_nests.items()}
        for key, other in (
            ("nests", replace(header, platform_nests=platform, base_nests=base)),
            ("nests.platform", replace(header, platform_nests=platform)),
            ("nests.base", replace(header, base_nests=base)),
        ):
            yield Way(
                "nests",
                f"[{key}] looks like {unit}, not mm",
                f"Write the nests in mm (these numbers times {factor:g})",
                replace(run, header=other),
                resized=True,
            )


def _two_ways(run: Run) -> Iterator[Way]:
    """Two ways of writing positions at once."""
    *lengths, mirrored = _of_positions(run)
    for first in lengths:
        second = list(_of_positions(first.run))[-1]
        yield replace(
            second,
            says=f"{first.says}; and {mirrored.says}",
            remedy=f"{first.remedy}. {mirrored.remedy}",
            resized=True,
        )
