"""Attained poses of a run with cycles, in the base frame, beside the commanded ones."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.frames import align
from calib.identify.alignment import collinear
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses, to_euler
from calib.mechanism.solve import forward
from calib.runs.record import Run


@dataclass(frozen=True, eq=False)
class Attained:
    """One commanded pose and what was attained, cycle by cycle.

    Attributes
    ----------
    label : str
    cycles : tuple of int
        Numbers of the cycles, in order.
    command, attained : (3,), (3, n)
        The judged point, mm, base frame.
    command_angles, attained_angles : (3,), (3, n), optional
        rx, ry, rz, rad; only where whole poses were read.
    """

    label: str
    cycles: tuple[int, ...]
    command: Array
    attained: Array
    command_angles: Array | None
    attained_angles: Array | None


@dataclass(frozen=True, eq=False)
class Campaign:
    """All poses of a run, which point is judged and how the base frame was found.

    ``frame`` is ``"base nests"`` or ``"fitted to the commands"`` (then a shift or turn of all
    poses together is not seen); ``left_out`` labels with fewer than two complete cycles.
    """

    poses: tuple[Attained, ...]
    point: str
    frame: str
    left_out: tuple[str, ...]


def campaign(machine: Machine, run: Run, point: str = "") -> Campaign:
    """Gather the cycles of a run.

    Parameters
    ----------
    machine : Machine
    run : Run
        Readings without a ``cycle`` are numbered by their repetition.
    point : str
        A platform nest whose SMR is judged. Empty: the platform's origin and its orientation
        where at least three nests were read in a cycle, else the only nest.

    Raises
    ------
    BadInput
        If the point was not read, or no pose was visited twice.
    """
    sights = _sights(run)
    nests = sorted({nest for held in sights.values() for nest in held}, key=str)
    if point and point not in nests:
        raise BadInput(
            f'nest "{point}" was not read', place=run.source, remedy=f"Read: {', '.join(nests)}."
        )
    places = run.header.platform_nests
    whole = (
        not point
        and len(nests) >= 3
        and not collinear(np.array([places[nest] for nest in nests]).T)
    )
    judged = point or ("" if whole else nests[0])
    commands = _commands(machine, run)
    frame, says = _frame(run, commands, sights)
    poses, left_out = [], []
    for label in dict.fromkeys(label for label, _ in sights):
        cycles = tuple(sorted(c for name, c in sights if name == label))
        held = {c: sights[label, c] for c in cycles}
        complete = tuple(
            c for c, seen in held.items() if (len(seen) == len(nests) if whole else judged in seen)
        )
        if len(complete) < 2:
            left_out.append(label)
            continue
        poses.append(
            _attained(label, complete, held, commands[label], judged, nests, places, frame)
        )
    if not poses:
        raise BadInput(
            "no pose was visited in two complete cycles",
            place=run.source,
            remedy="Measure with cycles: pkmcal measure --cycles 30.",
        )
    return Campaign(
        tuple(poses),
        f"nest {judged}" if judged else "platform origin",
        says,
        tuple(left_out),
    )


Sights = dict[tuple[str, int], dict[str, Array]]


def _sights(run: Run) -> Sights:
    """(label, cycle) -> nest -> reading (3,) in the tracker frame."""
    numbers = run.channels.get("cycle", np.full(len(run.nest), np.nan))
    counted: dict[tuple[str, str], int] = {}
    out: Sights = {}
    for row in np.flatnonzero(run.measured):
        label, nest = run.pose[row], run.nest[row]
        if not label or nest not in run.header.platform_nests:
            continue
        counted[label, nest] = counted.get((label, nest), 0) + 1
        number = numbers[row]
        cycle = int(number) if np.isfinite(number) else counted[label, nest]
        out.setdefault((label, cycle), {})[nest] = run.position[:, row]
    if not out:
        raise BadInput(
            "the run has no labelled readings on the platform",
            place=run.source,
            remedy="Fill in the column pose",
        )
    return out


def _commands(machine: Machine, run: Run) -> dict[str, Poses]:
    """Commanded pose by label: what the controller's own parameters make of the commanded q."""
    first: dict[str, int] = {}
    for row, label in enumerate(run.pose):
        if label and run.measured[row]:
            first.setdefault(label, row)
    held = run.header.controller_parameters
    q = run.q[:, list(first.values())]
    found = forward(machine, machine.extension(q, held), machine.vector(held))
    if not np.all(found.converged):
        label = list(first)[int(np.argmin(found.converged))]
        raise BadInput(
            f'the machine does not close at pose "{label}"',
            place=run.source,
            remedy="Check its q against the machine file",
        )
    return {label: found.poses.take(np.array([k])) for k, label in enumerate(first)}


def _frame(run: Run, commands: dict[str, Poses], sights: Sights) -> tuple[tuple[Array, Array], str]:
    """Rotation and translation from the tracker's frame to the base's, and how it was found."""
    rows = [row for row in np.flatnonzero(run.measured) if run.nest[row] in run.header.base_nests]
    base = np.array([run.header.base_nests[run.nest[row]] for row in rows]).reshape(-1, 3).T
    if not collinear(base):
        return align(run.position[:, rows], base), "base nests"
    places = run.header.platform_nests
    pairs = [
        (commands[label].points(places[nest][:, None])[:, 0], seen)
        for (label, _), held in sights.items()
        for nest, seen in held.items()
    ]
    wanted, seen = np.array([p for p, _ in pairs]).T, np.array([s for _, s in pairs]).T
    if collinear(wanted):
        raise BadInput(
            "neither base nests nor the poses tie the tracker's frame to the base",
            place=run.source,
            remedy="Read at least three base nests.",
        )
    return align(seen, wanted), "fitted to the commands"


def _attained(
    label: str,
    cycles: tuple[int, ...],
    held: dict[int, dict[str, Array]],
    command: Poses,
    judged: str,
    nests: list[str],
    places: Mapping[str, Array],
    frame: tuple[Array, Array],
) -> Attained:
    rotation, shift = frame
    if judged:
        seen = np.array([held[c][judged] for c in cycles]).T
        wanted = command.points(places[judged][:, None])[:, 0]
        return Attained(label, cycles, wanted, rotation @ seen + shift[:, None], None, None)
    local = np.array([places[nest] for nest in nests]).T
    positions, angles = [], []
    for c in cycles:
        points = rotation @ np.array([held[c][nest] for nest in nests]).T + shift[:, None]
        turn, place = align(local, points)
        positions.append(place)
        angles.append(to_euler(turn))
    return Attained(
        label,
        cycles,
        command.position[:, 0],
        np.array(positions).T,
        to_euler(command.rotation)[:, 0],
        np.array(angles).T,
    )
