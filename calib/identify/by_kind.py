"""How well readings of each kind are explained, in their own unit and by their own sigmas."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.arrays import Array, BoolArray, parts_of
from calib.identify.fitting import Fit
from calib.identify.taking import noise_covariance, noise_variances
from calib.runs.sensed import kind_words


@dataclass(frozen=True)
class OfKind:
    """Fitted readings of one kind.

    Attributes
    ----------
    kind : str
    readings, components : int
    unit : "mm" or "rad"
    rms, floor : float
        RMS of a component's residual, and what a perfect model would show, over components that
        are not a hundred times vaguer than the best of their run; nan where there are none.
    ratio : float
        Root of the sum of squared residuals in sigmas over what a perfect model would show.
    """

    kind: str
    readings: int
    components: int
    unit: str
    rms: float
    floor: float
    ratio: float


def by_kind(fit: Fit) -> tuple[OfKind, ...]:
    """Accepted readings by kind, in the order of :data:`calib.runs.sensing.KINDS`."""
    rows = fit.model.rows
    if rows.sensed is None:
        return (_of_kind(fit, "point", fit.accepted, angular=False),) if fit.readings else ()
    sensed = rows.sensed
    found = []
    for kind, turn in sorted(set(zip(sensed.kind.tolist(), sensed.turn.tolist(), strict=True))):
        which = fit.accepted & (sensed.kind == kind) & (sensed.turn == turn)
        if which.any():
            angular = bool(sensed.angular[which][0])
            found.append(_of_kind(fit, kind_words(kind, turn), which, angular=angular))
    return tuple(found)


def plain_kinds(fit: Fit) -> list[dict[str, Any]]:
    """The same as plain data, in um and urad."""

    def finite(value: float, factor: float = 1.0) -> float | None:
        return factor * value if math.isfinite(value) else None

    names = {"mm": ("um", 1e3), "rad": ("urad", 1e6)}
    return [
        {
            "kind": one.kind,
            "readings": one.readings,
            "components": one.components,
            "unit": names[one.unit][0],
            "rms": finite(one.rms, names[one.unit][1]),
            "floor": finite(one.floor, names[one.unit][1]),
            "ratio": finite(one.ratio),
        }
        for one in by_kind(fit)
    ]


def _of_kind(fit: Fit, name: str, which: BoolArray, *, angular: bool) -> OfKind:
    rows, linear = fit.model.rows, fit.linear
    live = rows.live[:, which]
    told = live if angular else rows.in_millimetres[:, which]
    own = noise_covariance(linear, fit.noise, which)
    noise = noise_variances(linear, fit.noise, which)
    expected = noise - _variance(fit, which, rows.unwhitener)
    leverage = _variance(fit, which)
    perfect = float(np.sum((np.einsum("iin->in", own) - leverage)[live]))
    squares = float(np.sum(linear.whitened[:, which] ** 2))
    return OfKind(
        kind=name,
        readings=int(which.sum()),
        components=int(live.sum()),
        unit="rad" if angular else "mm",
        rms=_root_mean(linear.residual[:, which] ** 2, told),
        floor=_root_mean(np.maximum(expected, 0.0), told),
        ratio=math.sqrt(squares / perfect) if perfect > 0.0 else float("nan"),
    )


def _variance(fit: Fit, which: BoolArray, root: Array | None = None) -> Array:
    """Variance (3, M) of the prediction, in sigmas or through ``root`` (3, 3, N)."""
    found = [np.zeros((3, 0))]
    for part in parts_of(which):
        columns = fit.linear.jacobian[:, :, part]
        if root is not None:
            columns = np.einsum("ijn,pjn->pin", root[:, :, part], columns)
        flat = columns.reshape(columns.shape[0], -1)
        variance = np.sum(flat * (fit.step_covariance @ flat), axis=0)
        found.append(variance.reshape(columns.shape[1:]))
    return np.concatenate(found, axis=1)


def _root_mean(squares: Array, told: BoolArray) -> float:
    return float(np.sqrt(np.mean(squares[told]))) if told.any() else float("nan")
