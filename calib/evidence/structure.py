"""Structure of unknown origin: does the residual depend on any state variable, in any way?

Responses are directions in which something could move the readings (each actuator's extension,
the point in space); variables are what it could depend on (pose coordinates, actuators, direction
of approach, time, temperature, payload, nest, range and angles of the tracker). A structure
candidate is every response times a few smooth functions of one variable. It is scored like an
effect, and says what the rest depends on, not why.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import legendre

from calib.arrays import Array
from calib.evidence.candidate import Candidate
from calib.evidence.columns import Columns
from calib.unknown import Unknown

ORDER = 4
"""Highest order of the smooth functions (Legendre polynomials over the variable's range)."""
MOST_PERIODS = 48
"""Periods that are tried at most for one variable, unless it says otherwise."""
MOST_NUMBERS = 10_000_000
"""Numbers in the columns of one variable beyond which fewer periods are tried (time)."""

Kind = Literal["smooth", "linear", "levels", "periodic"]


@dataclass(frozen=True, eq=False)
class Response:
    """Directions in which readings can be moved.

    ``columns`` (c, R) whitened displacement of the readings per ``unit``; ``size`` in that unit
    is how far things may reasonably be moved. Both are one for all directions, or one for each.
    """

    name: str
    columns: Array
    unit: str | tuple[str, ...] = "mm"
    size: float | tuple[float, ...] = 0.01

    def scale(self, axis: int) -> tuple[str, float]:
        """Unit and size of one direction, counted from 0."""
        unit = self.unit if isinstance(self.unit, str) else self.unit[axis]
        return unit, self.size[axis] if isinstance(self.size, tuple) else self.size


@dataclass(frozen=True, eq=False)
class Variable:
    """What the residual may depend on.

    Attributes
    ----------
    name : str
        Channel: ``q1``, ``time_s``, ``direction``, ``x``, ``structure_temp_C`` ...
    values : (R,) or (c, R)
        One value for each component; one row for each of the response's directions where each has
        a value of its own (direction of approach of each actuator).
    responses : tuple of Response
        What it may act on; each makes a candidate.
    kinds : tuple of "smooth", "linear", "levels", "periodic"
    shortest : float, optional
        Shortest period that is tried; default twice the median distance of distinct values.
    most_periods : int
        Periods that are tried at most; fewer where they would not fit into memory.
    """

    name: str
    values: Array
    responses: tuple[Response, ...]
    kinds: tuple[Kind, ...] = ("smooth",)
    shortest: float | None = None
    most_periods: int = MOST_PERIODS


def structure_candidates(variables: Sequence[Variable]) -> list[Candidate]:
    """Candidates for everything the residual could depend on; constant variables give none."""
    found = []
    for variable in variables:
        if not np.isfinite(variable.values).all() or np.ptp(variable.values) == 0.0:
            continue
        for response in variable.responses:
            for kind in variable.kinds:
                if kind == "smooth":
                    found.append(_smooth(variable, response, ORDER))
                elif kind == "linear":
                    found.append(_smooth(variable, response, 1))
                elif kind == "levels":
                    found.append(_levels(variable, response))
                else:
                    found.append(_periodic(variable, response))
    return found


def _smooth(variable: Variable, response: Response, most: int) -> Candidate:
    """Polynomials up to the order that the distinct values allow; lower orders stand alone too."""
    values = np.broadcast_to(variable.values, response.columns.shape)
    distinct = min(np.unique(row).size for row in values)
    order = max(1, min(most, distinct - 1))
    low, high = variable.values.min(), variable.values.max()
    scaled = 2.0 * (values - low) / (high - low) - 1.0
    count = response.columns.shape[0]
    columns = _of_shapes(count * order, response, lambda: _legendre(scaled, order))
    subsets = [tuple(range(count * top)) for top in range(1, order)]
    if count > 1:
        subsets += [tuple(range(axis, count * order, count)) for axis in range(count)]
    unknowns = tuple(
        Unknown(f"{variable.name}.{response.name}{axis + 1}.P{power}", *response.scale(axis))
        for power in range(1, order + 1)
        for axis in range(count)
    )
    name = f"{variable.name} ({response.name})"
    return Candidate(name, unknowns, columns, subsets=tuple(subsets), channel=variable.name)


def _of_shapes(count: int, response: Response, shapes: Callable[[], Array]) -> Columns:
    """Columns (1, count, R): every direction of a response times each of some shapes."""
    rows = response.columns.shape[1]

    def make(first: int, last: int) -> Array:
        return np.asarray((shapes() * response.columns).reshape(1, -1, rows)[first:last])

    return Columns((1, count, rows), make)


def _legendre(scaled: Array, order: int) -> Array:
    """P_1..P_order of values in [-1, 1]: (order, *shape)."""
    return np.asarray(np.moveaxis(legendre.legvander(scaled, order), -1, 0)[1:], dtype=np.float64)


def _levels(variable: Variable, response: Response) -> Candidate:
    """A constant for every distinct value (nests, passes)."""
    levels = np.unique(variable.values)
    count = response.columns.shape[0]
    columns = _of_shapes(
        count * levels.size,
        response,
        lambda: (variable.values == levels[:, None])[:, None, :],
    )
    unknowns = tuple(
        Unknown(f"{variable.name}.{response.name}{axis + 1}.{level:g}", *response.scale(axis))
        for level in levels
        for axis in range(count)
    )
    subsets = tuple(
        tuple(range(count * level, count * (level + 1))) for level in range(levels.size)
    )
    name = f"{variable.name} ({response.name}, levels)"
    return Candidate(name, unknowns, columns, subsets=subsets, channel=variable.name)


def _periodic(variable: Variable, response: Response) -> Candidate:
    """A sine and a cosine for every direction, at frequencies of :func:`_frequencies`."""
    values = np.broadcast_to(variable.values, response.columns.shape)
    span = float(np.ptp(values, axis=1).max())
    apart = np.diff(np.unique(variable.values))
    shortest = variable.shortest or max(2.0 * float(np.median(apart)), span / 100.0)
    fitting = MOST_NUMBERS // (2 * response.columns.size)
    most = max(MOST_PERIODS, min(variable.most_periods, fitting))
    frequencies = _frequencies(span, shortest, most)

    own = np.atleast_2d(variable.values) - values.min()

    def waves(frequency: Array) -> Array:
        phase = 2.0 * np.pi * frequency[:, None, None] * own
        shapes = np.stack([np.sin(phase), np.cos(phase)], axis=1)
        made = shapes * response.columns
        return np.asarray(made.reshape(frequency.size, -1, made.shape[-1]))

    count = response.columns.shape[0]
    columns = Columns(
        (frequencies.size, 2 * count, response.columns.shape[1]),
        lambda first, last: waves(frequencies[first:last]),
    )
    unknowns = tuple(
        Unknown(f"{variable.name}.{response.name}{axis + 1}.{wave}", *response.scale(axis))
        for wave in ("sin", "cos")
        for axis in range(count)
    )
    subsets = tuple((axis, count + axis) for axis in range(count)) if count > 1 else ()
    return Candidate(
        f"{variable.name} ({response.name}, periodic)",
        unknowns,
        columns,
        trials=tuple((float(1.0 / f),) for f in frequencies),
        subsets=subsets,
        channel=variable.name,
        between=lambda period: waves(np.array([1.0 / period]))[0],
    )


def _frequencies(span: float, shortest: float, most: int) -> Array:
    """Frequencies half an independent one apart; where these are too many, the lower half of them.

    What floors, air and shadows do is slow: the higher ones share the other half of what may be
    tried.
    """
    highest = max(1.0 / shortest, 1.5 / span)
    close = np.arange(1.0 / span, highest + 0.25 / span, 0.5 / span)
    if close.size <= most:
        return close
    slow = close[: most // 2]
    return np.concatenate([slow, np.linspace(slow[-1], highest, most // 2 + 1)[1:]])
