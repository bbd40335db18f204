"""An effect given by formulas: its columns by forward differentiation (see ``effect_file.py``)."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.component import Effect, Kind, Signature, Situation
from calib.effects.component import alone as alone_parts
from calib.formulas.expression import Expression, jumping_unknowns, linear_unknowns
from calib.formulas.functions import LABELS, OWN, POINT, POSE
from calib.formulas.states import own_states, point_states, pose_states, without_force
from calib.mechanism.axes import units_of
from calib.mechanism.rigid import rotate
from calib.runs.stack import Rows
from calib.unknown import Unknown

USUAL_MM = 0.01
"""Displacement that an effect of unstated size is taken to cause, RMS."""
TRIALS = 24
FINER = 25
"""Values between two trials of what jumps."""
OF_ONE = re.compile(rf"({'|'.join(OWN)})(?:([1-9]\d*)|\[(\w+)\])")
"""``s4`` or ``s[leg4]``: state of a particular actuator."""
LABEL = re.compile(rf"({'|'.join(LABELS)})\(\"(.*)\"\)")
FORGETS = {"s": (), "q": (), "l": (), "direction": ("direction",), "step": ("step",),
           "force": ("payload_kg",), "way": ("path",), "since": ("path", "time_s")}  # fmt: skip
"""Columns of the rows on which an own state depends beside the pose."""


@dataclass(frozen=True)
class Declared:
    """What an effect file declares beside its formulas.

    ``shared`` names the unknowns of which there is one for all actuators; ``axes`` the actuators
    that the formula is for, where these are not all; ``frame`` is that of a point's coordinates
    and of three formulas; ``text`` is the whole file: a model that is saved stays complete.
    """

    id: str
    says: str
    kind: Kind
    unknowns: tuple[Unknown, ...]
    shared: frozenset[str]
    acts_on: str
    source: str
    axes: tuple[str, ...] = ()
    frame: str = "tracker"
    text: str = ""


class OperatorEffect(Effect):
    """An effect given by formulas; see the module's text."""

    def __init__(self, declared: Declared, expressions: tuple[Expression, ...]) -> None:
        self.id, self.says, self.kind = declared.id, declared.says, declared.kind
        self.expressions, self.acts_on, self.frame = expressions, declared.acts_on, declared.frame
        self.source, self.only, self.text = declared.source, declared.axes, declared.text
        names = tuple(one.name for one in declared.unknowns)
        linear = {n for e in expressions for n in linear_unknowns(e, names)}
        for expression in expressions:
            present = {name for name in names if name in expression.names}
            linear -= present - set(linear_unknowns(expression, names))
        common = declared.shared if self.acts_on == "actuator" else frozenset(names)
        chosen = [one for one in declared.unknowns if one.name in linear]
        self.own = tuple(one for one in chosen if one.name not in common)
        self.common = tuple(one for one in chosen if one.name in common)
        self.linear = (*self.own, *self.common)
        self.searched = tuple(one for one in declared.unknowns if one.name not in linear)
        self.jumping = frozenset(n for e in expressions for n in jumping_unknowns(e, names))
        used = dict.fromkeys(name for e in expressions for name in e.names if name not in names)
        self.states = tuple(name for name in used if self._is_state(name))
        self.channels = tuple(name for name in used if not self._is_state(name))
        self.depends = self._dependences() if self.acts_on == "actuator" else ()

    def _is_state(self, name: str) -> bool:
        known = OWN if self.acts_on == "actuator" else POINT
        of_one = OF_ONE.fullmatch(name) or LABEL.fullmatch(name)
        return name in (*known, *POSE, "t") or bool(of_one)

    def _dependences(self) -> tuple[str, ...]:
        found: dict[str, None] = {}
        for name in self.states:
            one = OF_ONE.fullmatch(name)
            base = one.group(1) if one else name
            found |= dict.fromkeys(FORGETS.get(base, ()))
            found |= dict.fromkeys(("time_s",) if name == "t" else ())
            found |= dict.fromkeys(("path",) if LABEL.fullmatch(name) else ())
        return (*found, *(name for name in self.channels if name not in found))

    def unavailable(self, rows: Rows) -> str:
        """Say which column or actuator is missing, or where the formula has no value."""
        if reason := super().unavailable(rows):
            return reason
        own = {axis.name: axis for axis in rows.machine.axes}
        if strange := [name for name in self.only if name not in own]:
            return f"it is for {strange[0]}, and the machine has {', '.join(own)}"
        for name in self.states:
            if reason := self._unknown_state(rows, name, tuple(own)):
                return reason
        return self._undefined(rows)

    def _unknown_state(self, rows: Rows, name: str, axes: tuple[str, ...]) -> str:
        one = OF_ONE.fullmatch(name)
        if one and one.group(2) and int(one.group(2)) > len(axes):
            return f"the expression uses {name}, but there are {len(axes)} actuators"
        if one and one.group(3) and one.group(3) not in axes:
            return f"the expression uses {name}, and the machine has {', '.join(axes)}"
        if (one.group(1) if one else name) == "force" and (reason := without_force(rows)):
            return reason
        label = LABEL.fullmatch(name)
        if label is None:
            return ""
        there = rows.nest_name if label.group(1) == "nest" else rows.pose_name
        return "" if label.group(2) in there else f"no reading is of {name}"

    def _undefined(self, rows: Rows) -> str:
        """Where a formula is not finite at the first trial though its channels are known."""
        known = np.all([np.isfinite(rows.channels[n]) for n in self.channels], axis=0)
        known = np.broadcast_to(known, rows.count) & rows.on_platform
        shapes = self._shapes(self._columns(rows, rows.position), next(self.trials(rows)))
        bad = known & ~np.isfinite(np.sum(np.broadcast_arrays(*shapes), axis=(0, 1)))
        if not bad.any():
            return ""
        return f"the expression of {self.source} has no value at {rows.place(int(np.argmax(bad)))}"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``id.limb.k`` for each actuator, ``id.k`` of what is shared, and of what is searched."""
        axes = [rows.machine.axes[index] for index in self._which(rows)]
        sizes = self._sizes(rows)
        found = [
            replace(
                one,
                name=f"{self.id}.{axis.name}.{one.name}",
                size=_stated(one, float(sizes[one.name][number])),
            )
            for number, axis in enumerate(axes)
            for one in self.own
        ]
        found += [
            replace(one, name=f"{self.id}.{one.name}", size=_stated(one, float(sizes[one.name][0])))
            for one in self.common
        ]
        for one in self.searched:
            low, high = one.bounds or (1.0, 1.0)
            size, sigma = _stated(one, 0.5 * abs(high - low)), one.sigma
            if one.name in self.jumping:  # no derivative moves it: it is as sure as its search
                sigma = sigma or abs(high - low) / (one.steps * FINER)
            found.append(
                replace(one, name=f"{self.id}.{one.name}", size=size, sigma=sigma, nonlinear=True)
            )
        return tuple(found)

    def _which(self, rows: Rows) -> IntArray:
        """Indices of the actuators that the formula is for."""
        chosen = [not self.only or axis.name in self.only for axis in rows.machine.axes]
        return np.flatnonzero(chosen)

    def _sizes(self, rows: Rows) -> dict[str, Array]:
        """Sizes that move the readings by what is usual: of each actuator, or one for all."""
        shapes = self._shapes(self._columns(rows, rows.position), next(self.trials(rows)))
        usual = np.array([USUAL_MM])
        each: list[slice | IntArray] = [slice(None)]
        if self.acts_on == "actuator":
            which = self._which(rows)
            axes = [rows.machine.axes[index] for index in which]
            shapes = [shape[which] for shape in shapes]
            usual = np.array([axis.usual_error for axis in axes])
            each = list(units_of(axes).values())
        sizes = {}
        for one, shape in zip(self.linear, shapes, strict=True):
            groups = each if one in self.own else [slice(None)]
            seen = np.broadcast_to(shape / usual[:, None], shape.shape)[:, rows.on_platform]
            sizes[one.name] = usual.copy()
            for group in groups:
                known = seen[group][np.isfinite(seen[group])]
                rms = float(np.sqrt(np.mean(known**2))) if known.size else 0.0
                if rms > 0.0:
                    sizes[one.name][group] = 1.0 / rms
        return sizes

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """One actuator alone."""
        return alone_parts(self._which(rows).size, len(self.own)) if self.own else ()

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Every combination of the searched unknowns' values."""
        for values in product(*(_grid(one) for one in self.searched)):
            yield tuple(float(value) for value in values)

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """Values between the neighbours of the best trial, of what jumps."""
        finer = [
            _about(_grid(one), value) if one.name in self.jumping else [value]
            for one, value in zip(self.searched, trial, strict=True)
        ]
        for values in product(*finer):
            yield tuple(float(value) for value in values)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Derivatives by every unknown at ``values`` (U,)."""
        columns = self._columns(situation.rows, situation.point)
        count = values.size - len(self.searched)
        trial = tuple(float(v) for v in values[count:])
        shapes = self._shapes(columns, trial)
        linear = values[:count]
        if self.acts_on == "point":
            return self._moved(situation, shapes, columns, trial, linear)
        which = self._which(situation.rows)
        n, rows, own = len(situation.machine.actuators), situation.rows.count, len(self.own)
        out = np.zeros((values.size, n, rows))
        amplitudes = np.zeros((len(self.linear), n, 1))
        shared = own * which.size
        for number, shape in enumerate(shapes):
            if number < own:
                at = np.arange(which.size) * own + number
                out[at, which] = shape[which]
                amplitudes[number, which, 0] = linear[at]
            else:
                out[shared + number - own, which] = shape[which]
                amplitudes[number, which, 0] = linear[shared + number - own]
        for number, one in enumerate(self.searched):
            slope = self._slope(columns, trial, one.name, amplitudes)[0]
            out[count + number, which] = slope[which]
        return Signature(extension=out)

    def _moved(
        self,
        situation: Situation,
        shapes: list[Array],
        columns: Mapping[str, Array],
        trial: tuple[float, ...],
        linear: Array,
    ) -> Signature:
        """Displacements (U, 3, N): along the line of sight, or along the axes of the frame."""
        slopes = [
            self._slope(columns, trial, one.name, linear[:, None, None])[:, 0]
            for one in self.searched
        ]
        point = situation.point
        if len(self.expressions) == 1:
            sight = point / np.sqrt(np.sum(point**2, axis=0))
            return Signature(point=np.stack([part[0] * sight for part in (*shapes, *slopes)]))
        parts = [np.broadcast_to(shape, point.shape) for shape in shapes] + slopes
        moved = np.stack([np.broadcast_to(part, point.shape) for part in parts])
        if self.frame == "platform":
            return Signature(nest=moved * situation.rows.on_platform)
        if self.frame == "base":
            moved = np.stack([rotate(situation.frame_rotation, one) for one in moved])
        return Signature(point=moved)

    def _values(
        self, columns: Mapping[str, Array], trial: tuple[float, ...], linear: Mapping[str, Array]
    ) -> dict[str, Array]:
        searched = {one.name: np.asarray(v) for one, v in zip(self.searched, trial, strict=True)}
        return {**columns, **searched, **linear}

    def _like(self, columns: Mapping[str, Array]) -> tuple[int, ...]:
        """Shape of one formula's values: (n, N), or (1, N) of points."""
        return columns["t"].shape

    def _shapes(self, columns: Mapping[str, Array], trial: tuple[float, ...]) -> list[Array]:
        """Derivative by each linear unknown: (n or expressions, N)."""
        zero = {one.name: np.asarray(0.0) for one in self.linear}
        values = self._values(columns, trial, zero)
        names = frozenset(zero)
        slopes = [expression.evaluate(values, names)[1] for expression in self.expressions]
        rows = self._like(columns)
        answers = []
        for one in self.linear:
            parts = [np.broadcast_to(each.get(one.name, np.zeros(1)), rows) for each in slopes]
            answers.append(np.concatenate(parts) if len(parts) > 1 else parts[0])
        return answers

    def _slope(
        self, columns: Mapping[str, Array], trial: tuple[float, ...], name: str, linear: Array
    ) -> Array:
        """Derivative by a searched unknown: (expressions, n or 1, N), at ``linear`` (k, n, 1)."""
        amplitudes = {one.name: value for one, value in zip(self.linear, linear, strict=True)}
        values = self._values(columns, trial, amplitudes)
        rows = self._like(columns)
        slopes = [e.evaluate(values, frozenset((name,)))[1] for e in self.expressions]
        return np.stack([np.broadcast_to(each.get(name, np.zeros(1)), rows) for each in slopes])

    def _columns(self, rows: Rows, point: Array) -> dict[str, Array]:
        """What the formula names: (n, N) for actuators, (1, N) for points."""
        ones = {name: found for name in self.states if (found := OF_ONE.fullmatch(name))}
        plain = [name for name in OWN if name in self.states and self.acts_on == "actuator"]
        own = own_states(rows, {*plain, *(one.group(1) for one in ones.values())})
        columns: dict[str, Array] = {name: own[name] for name in plain}
        axes = [axis.name for axis in rows.machine.axes]
        for name, one in ones.items():
            index = int(one.group(2)) - 1 if one.group(2) else axes.index(one.group(3))
            columns[name] = own[one.group(1)][index]
        if self.acts_on == "point":
            columns |= point_states(rows, point, self.frame)
        if any(name in POSE for name in self.states):
            columns |= pose_states(rows)
        columns["t"] = rows.time_s
        for name in self.channels:
            columns[name] = rows.channels[name]
        for name in self.states:
            if label := LABEL.fullmatch(name):
                names = rows.nest_name if label.group(1) == "nest" else rows.pose_name
                columns[name] = np.array([label.group(2) == one for one in names], dtype=float)
        count = len(axes) if self.acts_on == "actuator" else 1
        return {n: np.broadcast_to(values, (count, rows.count)) for n, values in columns.items()}


def _stated(one: Unknown, usual: float) -> float:
    """Size that the file states, else the usual one."""
    return usual if math.isnan(one.size) else one.size


def _grid(one: Unknown) -> Array:
    low, high = one.bounds or (1.0, 1.0)
    if low > 0.0 and high / low > 3.0:
        return np.geomspace(low, high, one.steps)
    return np.linspace(low, high, one.steps)


def _about(grid: Array, value: float) -> Array:
    """Values between the neighbours of one of a grid."""
    at = int(np.argmin(np.abs(grid - value)))
    return np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)], FINER)
