"""Readings that a fit left out, seen together: a nest that moved, a pose that was not reached.

Strays that are off alike are no strays; a few are named here, many make the model inadequate
(:mod:`calib.look.judged`).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, IntArray
from calib.identify.fitting import Fit
from calib.identify.readings import MASKED
from calib.runs.remark import Remark, lines_in_words, ranges

LEAST = 2
"""Excluded readings that have something in common."""
HALF = 0.5
"""Part of a nest's or pose's readings from which on they are spoken of as one."""
ALIKE = 0.3
"""Scatter of their displacements, over the size, below which they are off alike."""
ONE_ACTUATOR = 0.9
"""Part of the misfit of a pose that one actuator must explain."""
MOST_POSES = 3
"""Poses that are named one by one."""
SAME_MM = 0.1
"""Distance, mm, within which two readings are of one place."""


@dataclass(frozen=True)
class Group:
    """Excluded rows that one hypothesis explains."""

    rows: tuple[int, ...]
    remark: Remark


def groups(fitted: Fit) -> list[Group]:
    """What excluded readings have in common; each reading in one group at most."""
    out = np.array(sorted(one.row for one in fitted.bad if one.why != MASKED), dtype=np.intp)
    found: list[Group] = []
    for search in (_not_moved, _nests, _poses):
        taken = {row for group in found for row in group.rows}
        left = np.array([row for row in out if row not in taken], dtype=np.intp)
        found += search(fitted, left)
    return found


def _not_moved(fitted: Fit, out: IntArray) -> Iterator[Group]:
    """Excluded readings that stand where the nest was at the stop before."""
    rows = fitted.model.rows
    same = []
    for row in out:
        own = np.flatnonzero([name == rows.nest_name[row] for name in rows.nest_name[: int(row)]])
        own = own[(rows.run[own] == rows.run[row])]
        if own.size == 0 or not rows.on_platform[row]:
            continue
        last = int(own[-1])
        apart = float(np.linalg.norm(rows.position[:, row] - rows.position[:, last]))
        if apart < SAME_MM and np.any(rows.q[:, row] != rows.q[:, last]):
            same.append(int(row))
    if same:
        lines = ranges(rows.line[same], rows.line)
        yield Group(
            tuple(same),
            _remark(
                fitted,
                "not-moved",
                f"The machine did not move before {lines_in_words(lines)}: the nest is where it "
                "was at the pose before",
                lines,
                f"The readings agree with those of the pose before within {SAME_MM:g} mm",
                "See why the command was not carried out, or written before it was; measure these "
                "poses again",
            ),
        )


def _nests(fitted: Fit, out: IntArray) -> Iterator[Group]:
    """Most readings of a nest, or all from some line on, off alike."""
    rows = fitted.model.rows
    names = np.array(rows.nest_name, dtype=object)
    for name in dict.fromkeys(names[out]):
        own = np.flatnonzero(names == name)
        gone = out[names[out] == name]
        late = own.size > gone.size and np.array_equal(own[-gone.size :], gone)
        if gone.size < LEAST or not (late or gone.size > HALF * own.size):
            continue
        moved = _displacements(fitted, gone)
        middle = np.median(moved, axis=1)
        size = float(np.linalg.norm(middle))
        if np.median(np.linalg.norm(moved - middle[:, None], axis=0)) > ALIKE * size:
            continue
        lines = ranges(rows.line[gone], rows.line[own])
        told = ", ".join(f"{value:+.3f}" for value in middle)
        what = f"moved before line {rows.line[gone[0]]}" if late else "is not where the table says"
        table = "platform" if rows.on_platform[gone[0]] else "base"
        yield Group(
            tuple(map(int, gone)),
            _remark(
                fitted,
                "nest-moved",
                f"Nest {name} {what}: {gone.size} of its {own.size} readings are off by "
                f"{size:.3g} mm ({told} mm in the {table} frame)",
                lines,
                "They are off alike; those of the other nests are not",
                f"Fasten nest {name}"
                if late
                else f"Correct {name} in [nests.{table}], or see which reflector was read",
            ),
        )


def _poses(fitted: Fit, out: IntArray) -> list[Group]:
    """Poses of which most readings are off; many of them are no matter of single poses."""
    found = list(_each_pose(fitted, out))
    return found if len(found) <= MOST_POSES else []


def _each_pose(fitted: Fit, out: IntArray) -> Iterator[Group]:
    """Most readings of a pose, off as if one actuator stood elsewhere."""
    rows, situation = fitted.model.rows, fitted.linear.situation
    names = np.array(rows.pose_name, dtype=object)
    for name in dict.fromkeys(names[out]):
        own = np.flatnonzero((names == name) & rows.on_platform)
        gone = out[names[out] == name]
        if not name or gone.size < LEAST or gone.size <= HALF * own.size:
            continue
        columns = situation.actuator_columns[:, :, gone]
        seen = fitted.linear.whitened[:, gone]
        weight = np.einsum("kin,kin->k", columns, columns)
        score = np.einsum("kin,in->k", columns, seen)
        explained = score**2 / np.maximum(weight, 1e-300) / float(np.sum(seen**2))
        k = int(np.argmax(explained))
        axis = rows.machine.actuators[k]
        lines = ranges(rows.line[gone], rows.line)
        twin = _same_command(fitted, gone)
        if twin:
            says = f"q1.. of pose {name} are those of pose {twin} to the last digit: copied"
            evidence = (
                f"The readings of {twin} stand in their nests, {gone.size} of {own.size} of {name} "
                "do not"
            )
        elif explained[k] > ONE_ACTUATOR:
            off = score[k] / weight[k]
            says = (
                f"At pose {name} {axis.name} stood about {off:+.3g} {axis.unit} from what q{k + 1} "
                "says: mistyped, or the actuator did not arrive"
            )
            evidence = (
                f"That explains {100 * explained[k]:.0f} % of what its {gone.size} excluded "
                "readings are off"
            )
        else:
            says = (
                f"Pose {name} was not where q says: {gone.size} of its {own.size} readings are off"
            )
            evidence = "They are off together; no single actuator explains it"
        yield Group(
            tuple(map(int, gone)),
            _remark(
                fitted,
                "pose-actuator",
                says,
                lines,
                evidence,
                f"Check q1.. in {lines_in_words(lines)}",
            ),
        )


def _same_command(fitted: Fit, gone: IntArray) -> str:
    """Another pose with the very q of these readings, whose own are good; empty if none."""
    rows = fitted.model.rows
    same = np.all(rows.q == rows.q[:, gone[:1]], axis=0) & rows.on_platform & fitted.accepted
    same &= rows.run == rows.run[gone[0]]
    others = [rows.pose_name[row] for row in np.flatnonzero(same)]
    return next((one for one in others if one and one != rows.pose_name[gone[0]]), "")


def _displacements(fitted: Fit, rows: IntArray) -> Array:
    """How far (3, M), mm, readings are off in the frame in which their nest is drawn."""
    situation, stacked = fitted.linear.situation, fitted.model.rows
    off = fitted.linear.residual[:, rows]
    base = np.einsum("jin,jn->in", situation.frame_rotation[:, :, rows], off)
    own = np.einsum("jin,jn->in", situation.rotation[:, :, rows], base)
    return np.asarray(np.where(stacked.on_platform[rows], own, base), dtype=np.float64)


def _remark(
    fitted: Fit, name: str, says: str, lines: tuple[tuple[int, int], ...], why: str, remedy: str
) -> Remark:
    return Remark(
        name,
        says,
        lines,
        why,
        "These readings are excluded",
        remedy,
        True,
        fitted.model.rows.runs[0].source,
    )
