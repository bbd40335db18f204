"""Nests that bear another's label, and nest tables that are mirrored.

Where a run as a whole could be either (the mirror image of a table may be the same table with
labels exchanged), the order of the labels decides which is said: people number holes
counter-clockwise about z; where they run clockwise the table is called mirrored.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import permutations

import numpy as np

from calib.arrays import Array, BoolArray
from calib.identify.alignment import robust_align
from calib.identify.starting import MAJORITY
from calib.look.places import Frame, Places
from calib.look.proposal import Proposal
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

MOST_NESTS = 5
"""Nests up to which all assignments are tried; of more, exchanges of two."""
SAME_HOLE = 0.05
"""Distance, mm, below which two nests are one."""
WHOLE = 0.9
"""Part of a nest's readings from which on a label is wrong in the whole run."""


def other_labels(places: Places) -> Proposal | None:
    """The labels that the readings have in the frame of the base, or of the majority."""
    frames = [] if places.from_base is None else [places.from_base]
    return _best(places, [*frames, places.majority[0]])


def any_labels(places: Places) -> Proposal | None:
    """The same for every assignment of the platform's labels that could hold for the whole run."""
    return None if places.from_base is not None else _best(places, _frames(places))


def _best(places: Places, frames: Iterable[Frame]) -> Proposal | None:
    best: Proposal | None = None
    for frame in frames:
        true, explained = _read_as(places, frame)
        if not _enough_right(places, true):
            continue
        count = int(explained.sum())
        if np.any(true != _labels(places)) and (best is None or count > best.explained):
            best = Proposal(count, partial(_relabelled, places, true))
    return best


def mirrored_table(places: Places) -> Proposal | None:
    """The mirror image of the nest table in which most readings stand where their nests are."""
    best: Proposal | None = None
    for axis in range(3):
        flip = np.ones((3, 1))
        flip[axis] = -1.0
        nests = np.where(places.rows.on_platform, flip * places.rows.nest, places.rows.nest)
        if np.allclose(nests, places.rows.nest):
            continue
        base = places.with_nests(nests)
        _, _, inside = robust_align(base, places.seen, places.slack)
        count = int(inside.sum())
        if count < places.rows.count - places.limit:
            continue  # half of a mirror image is some other mistake
        if best is None or count > best.explained:
            best = Proposal(count, partial(_mirrored, places, axis))
    return best


def _frames(places: Places) -> Iterator[Frame]:
    """The frame of the majority under each assignment."""
    platform = places.run.header.platform_nests
    names = [name for name in platform if name in set(places.rows.nest_name)]
    for assigned in _assignments(names):
        nests = places.rows.nest.copy()
        for label, name in assigned.items():
            nests[:, _labels(places) == label] = platform[name][:, None]
        base = places.with_nests(nests)
        rotation, position, _ = robust_align(base, places.seen, places.slack)
        yield rotation, position


def _assignments(names: list[str]) -> Iterator[Mapping[str, str]]:
    if len(names) <= MOST_NESTS:
        for order in permutations(names):
            if list(order) != names:
                yield dict(zip(names, order, strict=True))
        return
    for first in range(len(names)):
        for second in range(first):
            yield {names[first]: names[second], names[second]: names[first]}


def _labels(places: Places) -> np.ndarray:
    return np.array(places.rows.nest_name, dtype=object)


def _read_as(places: Places, frame: Frame) -> tuple[np.ndarray, BoolArray]:
    """Label (N,) of the nest in which each reading stands, its own first; and which stand in one.

    Readings that stand in none keep their labels.
    """
    header, labels = places.run.header, _labels(places)
    back, true = places.in_nest_frame(frame), _labels(places).copy()
    apart = np.linalg.norm(back - places.rows.nest, axis=0)
    explained = apart < places.slack
    nearest = np.where(explained, 0.0, np.inf)
    for table, kind in ((header.platform_nests, True), (header.base_nests, False)):
        here = places.rows.on_platform == kind
        for name, nest in table.items():
            distance = np.linalg.norm(back - nest[:, None], axis=0)
            other = here & (labels != name) & (distance < places.slack) & (distance < nearest)
            true[other], nearest[other] = name, distance[other]
            explained |= other
    return true, explained


def _enough_right(places: Places, true: np.ndarray) -> bool:
    """Whether enough labels are right; where not, the fit refuses the run, with the line.

    An exchange of two is plain even if no other nest was read; so are labels that go round, each
    read as one other throughout.
    """
    labels = _labels(places)
    wrong = true != labels
    pairs = set(zip(labels[wrong], true[wrong], strict=True))
    exchange = len(pairs) == 2 and {(b, a) for a, b in pairs} == pairs
    round_ = (
        len(pairs) == len({label for label, _ in pairs}) == len({name for _, name in pairs})
        and {label for label, _ in pairs} == {name for _, name in pairs}
        and all(np.mean(wrong[labels == label]) > WHOLE for label, _ in pairs)
    )
    return exchange or round_ or bool(np.mean(~wrong) >= MAJORITY)


def _relabelled(places: Places, true: np.ndarray) -> tuple[Run, Remark]:
    """The run with the labels that the readings have, and what is said of it."""
    run, labels = places.run, _labels(places)
    wrong = true != labels
    pairs = Counter(zip(labels[wrong], true[wrong], strict=True))
    which = np.flatnonzero(run.measured)
    nest = list(run.nest)
    for row, name in zip(which, true, strict=True):
        nest[row] = str(name)
    concerned = {label for label, _ in pairs}
    among = run.line[which][np.isin(labels, list(concerned))]
    lines = ranges(places.rows.line[wrong], among)
    whole = all(np.mean(wrong[labels == label]) > WHOLE for label in concerned)
    named = _exchange_in_words(pairs)
    mirrored = whole and _image(places, pairs)
    where = "throughout" if whole else f"in {lines_in_words(lines)}"
    says = f"{named} {where}"
    if mirrored:
        says = (
            f"The nest table is mirrored (left-handed): its labels run clockwise, and {named} "
            f"{where}"
        )
    elif whole and _image(places, pairs, turning=None):
        says += " (or, which is the same, the nest table is mirrored)"
    return replace(run, nest=tuple(nest)), Remark(
        "nests-mirrored" if mirrored else "nests-exchanged",
        says[0].upper() + says[1:],
        lines,
        f"{int(wrong.sum())} readings stand in the other nest, none in their own",
        "Fitted with the nest table mirrored back; nothing is excluded for it"
        if mirrored
        else "Fitted with the labels exchanged; nothing is excluded for it",
        "Correct [nests.platform] in run.toml: the drawing was read from behind"
        if mirrored
        else "Correct the column nest in points.csv, or the names in run.toml",
        True,
        run.source,
    )


def _exchange_in_words(pairs: Mapping[tuple[str, str], int]) -> str:
    """``nests 4 and 5 are exchanged``, or who reads as whom."""
    names = sorted({name for pair in pairs for name in pair})
    if len(pairs) == 2 and len(names) == 2:
        return f"nests {names[0]} and {names[1]} are exchanged"
    told = ", ".join(f"nest {a} reads as {b}" for a, b in sorted(pairs))
    if {a for a, _ in pairs} == {b for _, b in pairs}:
        return f"nests {', '.join(names)} are exchanged ({told})"
    return told


def _image(
    places: Places, pairs: Mapping[tuple[str, str], int], turning: bool | None = True
) -> bool:
    """Whether the exchanged table is the table's own mirror image, its labels running clockwise.

    ``turning`` None: whichever way they run.
    """
    table = places.run.header.platform_nests
    true = dict(table)
    for label, name in pairs:
        if label not in table or name not in table:
            return False
        true[label] = table[name]
    names = [name for name in table if name in set(places.rows.nest_name)]
    if len(names) < 3:
        return False
    for axis in range(3):
        flip = np.ones(3)
        flip[axis] = -1.0
        if all(np.linalg.norm(flip * table[name] - true[name]) < SAME_HOLE for name in names):
            return turning is None or _clockwise([table[name] for name in names])
    return False


def _clockwise(nests: list[Array]) -> bool:
    """Whether the first three nests, in the order of the table, run clockwise about z."""
    first, second, third = nests[:3]
    return bool(np.cross(second - first, third - first)[2] < 0.0)


def _mirrored(places: Places, axis: int) -> tuple[Run, Remark]:
    run = places.run
    flip = np.ones(3)
    flip[axis] = -1.0
    table = {name: flip * nest for name, nest in run.header.platform_nests.items()}
    name = "xyz"[axis]
    return replace(run, header=replace(run.header, platform_nests=table)), Remark(
        "nests-mirrored",
        f"The nest table is mirrored (left-handed): {name} of all platform nests has the wrong "
        "sign",
        (),
        "With the mirror image the readings stand in their nests, as it is written they do not",
        f"Fitted with {name} of [nests.platform] turned round; nothing is excluded for it",
        f"Correct {name} in [nests.platform]: the drawing was read from behind",
        True,
        run.source,
    )
