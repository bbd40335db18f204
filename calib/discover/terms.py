"""A library of formulas for a run, and the proposal of an operator's effect from it.

Beside shapes that are known from machines there are the products of any two states
(:mod:`calib.discover.products`), the units of their coefficients derived.

Every formula of the library is an effect file's (``calib.formulas.effect_file``), so that what is
proposed can be saved, read and refined by hand. Variables are centred and scaled in the formulas
themselves where that keeps numbers readable.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import IntArray
from calib.discover.problem import effect_candidates
from calib.discover.products import actuator_products, point_products
from calib.errors import BadInput
from calib.evidence.terms import Selected, select_terms
from calib.formulas.effect_file import effect_from_text
from calib.formulas.formula_effect import OperatorEffect
from calib.identify.fitting import Fit
from calib.identify.holdout import hold_out
from calib.identify.signatures import effect_columns
from calib.identify.staged import fit_effects
from calib.mechanism.axes import units_of

PERIODS = 48


@dataclass(frozen=True)
class Formula:
    """One entry of the library.

    ``text`` holds the unknowns as ``{a}``, ``{b}`` ... with ``units``; ``searched`` is a nonlinear
    unknown as (name, unit, from, to) or None; ``axes`` names the actuators that it is for, where
    these are not all.
    """

    text: tuple[str, ...]
    units: tuple[str, ...]
    acts_on: str
    shared: bool
    searched: tuple[str, str, float, float] | None = None
    axes: tuple[str, ...] = ()

    def table(self, identifier: str, says: str, letters: Sequence[str]) -> str:
        """The formula as the text of an effect file."""
        names = dict(zip("abc", letters, strict=False))
        parts = [f'"{one.format(**names)}"' for one in self.text]
        unknowns = [f'{x} = "{unit}"' for x, unit in zip(letters, self.units, strict=False)]
        if self.searched is not None:
            name, unit, low, high = self.searched
            unknowns.append(
                f'{name} = {{ unit = "{unit}", from = {low:.6g}, to = {high:.6g}, '
                f"steps = {PERIODS} }}"
            )
        lines = [
            "[effect]",
            f'id = "{identifier}"',
            f'says = "{says}"',
            f'acts_on = "{self.acts_on}"',
            f"expression = {parts[0] if len(parts) == 1 else '[' + ', '.join(parts) + ']'}",
            f"unknowns = {{ {', '.join(unknowns)} }}",
        ]
        if self.shared:
            lines.append("shared = true")
        if self.axes:
            axes = [f'"{name}"' for name in self.axes]
            lines.append(f"axes = [{', '.join(axes)}]")
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, eq=False)
class ProposedTerm:
    """A term for what is left, as an operator's effect file.

    Attributes
    ----------
    formula : str
        For people.
    text : str
        The effect file.
    selected : Selected
        Evidence and stability.
    explains_mm : float
        RMS over readings of what it explains.
    held_out_mm : tuple of float
        RMS over poses that the fit has not seen, without it and with it, fitted anew; nan where
        the model with it cannot be fitted.
    """

    formula: str
    text: str
    selected: Selected
    explains_mm: float
    held_out_mm: tuple[float, float]

    @property
    def good(self) -> bool:
        """Whether most halves call for it, and poses that the fit has not seen are for it."""
        return self.selected.stable and self.held_out_mm[1] < self.held_out_mm[0]


def library(fit: Fit) -> list[Formula]:
    """Formulas in actuator space (one for all of a unit, or one each) and in point space."""
    axes = fit.model.rows.machine.axes
    units = units_of(axes)
    varying = _varying(fit)
    found = []
    for unit, own in units.items():
        named = tuple(axes[index].name for index in own) if len(units) > 1 else ()
        found += [replace(formula, axes=named) for formula in _of_actuators(fit, unit, varying)]
    found += [_along(_centred(*one), f"mm per unit of {one[0]}") for one in varying]
    found += _points_of_time(fit)
    for text in ("range**2", "range**3", "elevation", "elevation**2", "sin(2*azimuth)"):
        found.append(Formula((f"{{a}} * {text}",), ("mm",), "point", True))
    channels = [(name, _centred(name, low, high)) for name, low, high in varying]
    found += [_along(one.text, one.unit) for one in point_products(channels)]
    waves = ("sin(azimuth)", "cos(azimuth)", "sin(2*azimuth)", "cos(2*azimuth)", "elevation**2")
    found += [_along(one, "mm") for one in waves]
    return found


def _of_actuators(
    fit: Fit, unit: str, varying: Sequence[tuple[str, float, float]]
) -> list[Formula]:
    """Formulas of actuators in ``unit``: of their own motion, of channels, of time."""
    own = [
        (("{a} * s**2",), (f"1/{unit}",)),
        (("{a} * s**3",), (f"1/{unit}^2",)),
        (("{a} * abs(s)",), ("1",)),
        (("{a} * direction",), (unit,)),
        (("{a} * s * direction",), ("1",)),
        (("{a} * step",), ("1",)),
        (("{a} * s**2 * direction",), (f"1/{unit}",)),
    ]
    found = [
        Formula(text, units, "actuator", shared) for text, units in own for shared in (True, False)
    ]
    for name, low, high in varying:
        centre, per = _centred(name, low, high), f"{unit} per unit of {name}"
        found += [
            Formula((text,), (per,), "actuator", shared)
            for text in (f"{{a}} * {centre}", f"{{a}} * {centre} * s", f"{{a}} * {centre}**2")
            for shared in (True, False)
        ]
    channels = [(name, _centred(name, low, high)) for name, low, high in varying]
    known = {formula.text[0] for formula in found}
    found += [
        Formula((one.text,), (one.unit,), "actuator", shared)
        for one in actuator_products(unit, channels, timed=_span(fit) is not None)
        for shared in ((True, False) if one.own else (True,))
        if one.text not in known
    ]
    return [*found, *_of_time(fit, unit)]


def _centred(name: str, low: float, high: float) -> str:
    return f"({name} - {0.5 * (low + high):.6g})"


def _along(shape: str, unit: str) -> Formula:
    """A displacement of the point in any fixed direction of the tracker frame."""
    text = tuple(f"{{{x}}} * {shape}" for x in "abc")
    return Formula(text, (unit,) * 3, "point", True)


def _varying(fit: Fit) -> list[tuple[str, float, float]]:
    """Channels that vary, with their range."""
    found = []
    for name, values in fit.model.rows.channels.items():
        known = values[fit.accepted & np.isfinite(values)]
        if known.size and np.ptp(known) > 1e-9 * max(1.0, float(np.abs(known).max())):
            found.append((name, float(known.min()), float(known.max())))
    return found


WAVE = "{a} * sin(2*pi*t/p) + {b} * cos(2*pi*t/p)"


def _span(fit: Fit) -> tuple[float, float] | None:
    """How long the readings last and the shortest period in them, s; None for a few readings."""
    time = np.unique(fit.model.rows.time_s[fit.accepted])
    span = float(np.ptp(time))
    if time.size < 12 or span <= 0.0:
        return None
    return span, max(4.0 * span / time.size, span / (0.5 * PERIODS))


def _of_time(fit: Fit, unit: str) -> list[Formula]:
    """Waves and warming-up of actuators, where the run lasts long enough to see them."""
    known = _span(fit)
    if known is None:
        return []
    span, low = known
    period, decay = ("p", "s", low, span), ("tau", "s", span / 20.0, span)
    found = [Formula((WAVE,), (unit, unit), "actuator", shared, period) for shared in (True, False)]
    found += [
        Formula(("{a} * exp(-t/tau)",), (unit,), "actuator", shared, decay)
        for shared in (True, False)
    ]
    return found


def _points_of_time(fit: Fit) -> list[Formula]:
    """Waves of the point along each axis of the tracker frame."""
    known = _span(fit)
    if known is None:
        return []
    span, low = known
    texts = [tuple(WAVE if axis == own else "0" for axis in range(3)) for own in range(3)]
    return [Formula(text, ("mm", "mm"), "point", True, ("p", "s", low, span)) for text in texts]


def propose(fit: Fit, rng: np.random.Generator) -> list[ProposedTerm]:
    """Propose terms for what a fit leaves, in the order in which they are called for."""
    formulas = library(fit)
    effects: list[OperatorEffect] = []
    kept: list[Formula] = []
    for number, formula in enumerate(formulas):
        effect = effect_from_text(formula.table(f"term-{number}", "a term", "abc"), "library")
        if not effect.unavailable(fit.model.rows):
            effects.append(effect)
            kept.append(formula)
    problem = fit.problem
    candidates = effect_candidates(fit, problem, effect_columns(fit, effects))
    found = select_terms(problem, candidates, _poses(fit), rng)
    before = hold_out(fit).rms_mm if found else float("nan")
    return [
        _proposal(fit, kept[one.index], number, one, before) for number, one in enumerate(found)
    ]


def _poses(fit: Fit) -> IntArray:
    """Number of the pose of each component (3 A,), -1 for reference readings."""
    rows = fit.model.rows
    names = [
        (int(run), name) if on else None
        for run, name, on in zip(rows.run, rows.pose_name, rows.on_platform, strict=True)
    ]
    numbers = {name: k for k, name in enumerate(dict.fromkeys(n for n in names if n is not None))}
    one = np.array([-1 if name is None else numbers[name] for name in names])[fit.accepted]
    return np.tile(one.astype(np.intp), 3)


def _proposal(
    fit: Fit, formula: Formula, number: int, found: Selected, before: float
) -> ProposedTerm:
    moved = fit.model.rows.in_mm(found.fitted.reshape(3, -1), fit.accepted)
    said = ", ".join(one.format(a="a", b="b", c="c") for one in formula.text)
    says = f"proposed from the residual: {said}"
    if found.trial:
        name = formula.searched[0] if formula.searched else "x"
        said += f" with {name} near {found.trial[0]:.4g}"
    text = formula.table(f"found-{number + 1}", says, "abc")
    after = _held_out_with(fit, text)
    gain = f"# RMS of poses that the fit has not seen: {1e3 * before:.2f} um without, "
    return ProposedTerm(
        formula=said,
        text=f"{gain}{1e3 * after:.2f} um with it.\n{text}",
        selected=found,
        explains_mm=float(np.sqrt(np.mean(np.sum(moved**2, axis=0)))),
        held_out_mm=(before, after),
    )


def _held_out_with(fit: Fit, text: str) -> float:
    """RMS, mm, of poses that the fit has not seen with one more effect; nan without such a fit."""
    effect = effect_from_text(text, "proposal")
    try:
        larger = fit_effects(fit.model.rows, [*fit.model.effects, effect], begun=fit)
    except BadInput:
        return float("nan")
    return hold_out(larger).rms_mm
