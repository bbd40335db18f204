"""An effect given by formulas: its columns by forward differentiation (see ``operator.py``)."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.component import Effect, Kind, Signature, Situation
from calib.effects.component import alone as alone_parts
from calib.formulas.expression import (
    Expression,
    linear_unknowns,
)
from calib.mechanism.axes import units_of
from calib.runs.stack import Rows
from calib.unknown import Unknown

USUAL_MM = 0.01
"""Displacement that an effect of unstated size is taken to cause, RMS."""
TRIALS = 24
OWN = ("s", "q", "l", "direction", "step")
POINT = ("x", "y", "z", "range", "azimuth", "elevation")
NUMBERED = re.compile(r"(s|q|l|direction|step)([1-9]\d*)")


class OperatorEffect(Effect):
    """An effect given by formulas; see the module's text."""

    def __init__(
        self,
        identifier: str,
        says: str,
        kind: Kind,
        expressions: tuple[Expression, ...],
        declared: tuple[Unknown, ...],
        shared: bool,
        acts_on: str,
        source: str,
        axes: tuple[str, ...] = (),
        text: str = "",
    ) -> None:
        self.id, self.says, self.kind = identifier, says, kind
        self.expressions, self.shared, self.acts_on = expressions, shared, acts_on
        self.source, self.only = source, axes
        self.text = text  # of the whole file: a model that is saved stays complete
        names = tuple(one.name for one in declared)
        linear = {n for e in expressions for n in linear_unknowns(e, names)}
        for expression in expressions:
            present = {name for name in names if name in expression.names}
            linear -= present - set(linear_unknowns(expression, names))
        self.linear = tuple(one for one in declared if one.name in linear)
        self.searched = tuple(one for one in declared if one.name not in linear)
        used = dict.fromkeys(name for e in expressions for name in e.names if name not in names)
        known = POINT if acts_on == "point" else OWN
        self.channels = tuple(
            n for n in used if n not in known and n != "t" and not self._numbered(n)
        )
        states = ["time_s"] if "t" in used else []
        states += [n for n in ("direction", "step") if any(u.startswith(n) for u in used)]
        self.depends = (*states, *self.channels) if acts_on == "actuator" else ()

    def _numbered(self, name: str) -> bool:
        return self.acts_on == "actuator" and bool(NUMBERED.fullmatch(name))

    def unavailable(self, rows: Rows) -> str:
        """Say which column is missing, or where the formula has no value."""
        if reason := super().unavailable(rows):
            return reason
        own = {axis.name: axis for axis in rows.machine.axes}
        if strange := [name for name in self.only if name not in own]:
            return f"it is for {strange[0]}, and the machine has {', '.join(own)}"
        count = len(own)
        for expression in self.expressions:
            for name in expression.names:
                found = NUMBERED.fullmatch(name) if self._numbered(name) else None
                if found and int(found.group(2)) > count:
                    return f"the expression uses {name}, but there are {count} actuators"
        return self._undefined(rows)

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
        """``id.limb.k`` for each actuator, or ``id.k``; then the searched ones, ``id.tau``."""
        axes = [rows.machine.axes[index] for index in self._which(rows)]
        prefixes = [""] if self._common else [f"{axis.name}." for axis in axes]
        sizes = self._sizes(rows)
        found = [
            replace(
                one,
                name=f"{self.id}.{prefix}{one.name}",
                size=_stated(one, float(sizes[one.name][number])),
            )
            for number, prefix in enumerate(prefixes)
            for one in self.linear
        ]
        for one in self.searched:
            low, high = one.bounds or (1.0, 1.0)
            size = _stated(one, 0.5 * abs(high - low))
            found.append(replace(one, name=f"{self.id}.{one.name}", size=size, nonlinear=True))
        return tuple(found)

    @property
    def _common(self) -> bool:
        return self.shared or self.acts_on == "point"

    def _which(self, rows: Rows) -> IntArray:
        """Indices of the actuators that the formula is for."""
        chosen = [not self.only or axis.name in self.only for axis in rows.machine.axes]
        return np.flatnonzero(chosen)

    def _sizes(self, rows: Rows) -> dict[str, Array]:
        """Sizes that move the readings by what is usual: of each actuator, or one for all."""
        shapes = self._shapes(self._columns(rows, rows.position), next(self.trials(rows)))
        usual = np.array([USUAL_MM])
        groups: list[slice | IntArray] = [slice(None)]
        if self.acts_on == "actuator":
            which = self._which(rows)
            axes = [rows.machine.axes[index] for index in which]
            shapes = [shape[which] for shape in shapes]
            usual = np.array([axis.usual_error for axis in axes])
            if not self.shared:
                groups = list(units_of(axes).values())
        sizes = {}
        for one, shape in zip(self.linear, shapes, strict=True):
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
        if self._common:
            return ()
        return alone_parts(self._which(rows).size, len(self.linear))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Every combination of the searched unknowns' values."""
        grids = [_grid(one) for one in self.searched]
        if not grids:
            yield ()
            return
        for values in np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, len(grids)):
            yield tuple(float(value) for value in values)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Derivatives by every unknown at ``values`` (U,)."""
        columns = self._columns(situation.rows, situation.point)
        count = len(self.searched)
        trial = tuple(float(v) for v in values[values.size - count :])
        shapes = self._shapes(columns, trial)
        linear = values[: values.size - count]
        if self.acts_on == "point":
            return Signature(point=self._point(situation, shapes, columns, trial, linear))
        which = self._which(situation.rows)
        n, rows = len(situation.machine.actuators), situation.rows.count
        out = np.zeros((values.size, n, rows))
        for number, shape in enumerate(shapes):
            if self._common:
                out[number, which] = shape[which]
            else:
                at = np.arange(which.size) * len(self.linear) + number
                out[at, which] = shape[which]
        amplitudes = np.zeros((len(self.linear), n, 1))
        amplitudes[:, which, 0] = linear.reshape(-1, len(self.linear)).T
        for number, one in enumerate(self.searched):
            slope = self._slope(columns, trial, one.name, amplitudes)[0]
            out[values.size - count + number, which] = slope[which]
        return Signature(extension=out)

    def _point(
        self,
        situation: Situation,
        shapes: list[Array],
        columns: Mapping[str, Array],
        trial: tuple[float, ...],
        linear: Array,
    ) -> Array:
        """Displacements (U, 3, N): along the line of sight, or along x, y and z."""
        slopes = [
            self._slope(columns, trial, one.name, linear[:, None, None])[:, 0]
            for one in self.searched
        ]
        point = situation.point
        if len(self.expressions) == 3:
            parts = [np.broadcast_to(shape, point.shape) for shape in shapes] + slopes
            return np.stack([np.broadcast_to(part, point.shape) for part in parts])
        sight = point / np.sqrt(np.sum(point**2, axis=0))
        return np.stack([part[0] * sight for part in (*shapes, *slopes)])

    def _values(
        self, columns: Mapping[str, Array], trial: tuple[float, ...], linear: Mapping[str, Array]
    ) -> dict[str, Array]:
        searched = {one.name: np.asarray(v) for one, v in zip(self.searched, trial, strict=True)}
        return {**columns, **searched, **linear}

    def _shapes(self, columns: Mapping[str, Array], trial: tuple[float, ...]) -> list[Array]:
        """Derivative by each linear unknown: (n or expressions, N)."""
        zero = {one.name: np.asarray(0.0) for one in self.linear}
        values = self._values(columns, trial, zero)
        names = frozenset(zero)
        slopes = [expression.evaluate(values, names)[1] for expression in self.expressions]
        like = next(iter(columns.values())).shape
        rows = (1, like[-1]) if self.acts_on == "point" else like
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
        like = next(iter(columns.values())).shape
        rows = (1, like[-1]) if self.acts_on == "point" else like
        slopes = [e.evaluate(values, frozenset((name,)))[1] for e in self.expressions]
        return np.stack([np.broadcast_to(each.get(name, np.zeros(1)), rows) for each in slopes])

    def _columns(self, rows: Rows, point: Array) -> dict[str, Array]:
        """What the formula may name: (n, N) for actuators, (1, N) for points."""
        columns: dict[str, Array] = {}
        if self.acts_on == "point":
            x, y, z = point
            ranges, ground = np.sqrt(x**2 + y**2 + z**2), np.hypot(x, y)
            named = (x, y, z, ranges, np.arctan2(y, x), np.arctan2(z, ground))
            columns = {name: values[None] for name, values in zip(POINT, named, strict=True)}
        else:
            own = (
                rows.extension, rows.q, rows.machine.coordinates(rows.extension),
                rows.direction, rows.step,
            )  # fmt: skip
            columns = dict(zip(OWN, own, strict=True))
            for name, values in list(columns.items()):
                for actuator, row in enumerate(values):
                    columns[f"{name}{actuator + 1}"] = np.broadcast_to(row, values.shape)
        like = next(iter(columns.values())).shape
        columns["t"] = np.broadcast_to(rows.time_s, like)
        for name in self.channels:
            columns[name] = np.broadcast_to(rows.channels[name], like)
        return columns


def _stated(one: Unknown, usual: float) -> float:
    """Size that the file states, else the usual one."""
    return usual if math.isnan(one.size) else one.size


def _grid(one: Unknown) -> Array:
    low, high = one.bounds or (1.0, 1.0)
    if low > 0.0 and high / low > 3.0:
        return np.geomspace(low, high, one.steps)
    return np.linspace(low, high, one.steps)
