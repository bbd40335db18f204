"""What a fit would write to a controller, what it would not, and why not.

Effects of the *measurement* are never written. Of the machine effects a controller can take those
for which it has compensation values. What was fitted is what was left beside the values that it
used while the run was taken, so the two are added: writing a fit twice writes the same values.

Where the host computes the motion it takes the whole model: every effect of the machine, the
operator's own formulas on actuators with their texts. Its runs hold what was sent, so a fit finds
the whole of each effect; what the fit does not have is no longer compensated.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePath

from app.files.fits import SavedFit
from app.hosted.parameters import effect_of
from calib.command.identified import why_not
from calib.effects import effect_named
from calib.errors import BadInput
from calib.mechanism.description import Machine

SAME_SIGMAS = 0.01
"""Two values closer than this part of their uncertainty are the same value."""


@dataclass(frozen=True)
class Change:
    """One parameter: ``old`` in the controller, ``new`` proposed, ``sigma`` of the estimate."""

    name: str
    old: float
    new: float
    sigma: float
    unit: str
    identified: bool

    @property
    def in_sigmas(self) -> float:
        """Difference in standard uncertainties of the estimate; nan where there is none."""
        return (self.new - self.old) / self.sigma if self.sigma > 0.0 else math.nan


@dataclass(frozen=True)
class Proposal:
    """All changes, and what the fit found that is not written: name -> why."""

    changes: tuple[Change, ...]
    left_out: Mapping[str, str]
    own: Mapping[str, str] = field(default_factory=dict)
    """Texts of the operator's own effects among the values, by id."""
    given_up: tuple[str, ...] = ()
    """Names that are held and that the whole model does not have: they are taken out."""

    @property
    def changes_something(self) -> bool:
        """Whether any value differs from the one held by more than rounding and fitting again do.

        A run that is fitted again ends within a thousandth of an uncertainty of where it ended.
        """
        return bool(self.given_up) or any(
            change.new != change.old and not abs(change.in_sigmas) < SAME_SIGMAS
            for change in self.changes
        )

    @property
    def values(self) -> dict[str, float]:
        """What would be written."""
        return {change.name: change.new for change in self.changes}

    def over(self, held: Mapping[str, float]) -> dict[str, float]:
        """The whole set after writing, from the one that is held."""
        kept = {name: value for name, value in held.items() if name not in self.given_up}
        return {**kept, **self.values}


def propose(
    machine: Machine, fit: SavedFit, held: Mapping[str, float], *, hosted: bool = False
) -> Proposal:
    """Compare a fit with what the controller holds.

    Parameters
    ----------
    hosted : bool
        Whether the host computes the motion, and takes the whole model.

    Raises
    ------
    BadInput
        If the fit is of another machine, or lacks a parameter of this one.
    """
    _check_whole(machine, fit)
    changes = [_change(fit, p.name, held, 0.0) for p in machine.parameters]
    if hosted:
        return _whole_model(machine, fit, held, changes)
    left_out: dict[str, str] = {}
    for effect in fit.effects:
        found = [name for name in fit.estimates if name.startswith(f"{effect}.")]
        if reason := _not_of_the_machine(effect, machine):
            left_out[effect] = f"{reason}; never written"
        elif fit.compensation is None and any(held[n] != 0.0 for n in held if n.startswith(effect)):
            left_out[effect] = (
                "the file does not say what the controller compensated when the run was taken; "
                "use the model file of pkmcal fit --save"
            )
        elif effect == "screw-cyclic":
            changes += _cyclic(fit, held, left_out)
        elif found and all(name in held for name in found):
            used = fit.compensation or {}
            changes += [_change(fit, name, held, used.get(name, 0.0)) for name in found]
        else:
            left_out[effect] = "the controller has no compensation for it; its error stays"
    return Proposal(tuple(changes), left_out)


def _whole_model(
    machine: Machine, fit: SavedFit, held: Mapping[str, float], changes: list[Change]
) -> Proposal:
    """Every effect of the machine; what is held beyond that is given up.

    Raises
    ------
    BadInput
        If the runs were taken with a controller that compensated something itself: the fit has
        what was left beside that, and a host has nothing to leave it beside.
    """
    used = {name: value for name, value in (fit.compensation or {}).items() if value != 0.0}
    if used:
        raise BadInput(
            f"a controller compensated {next(iter(used))} while the runs were taken; the fit has "
            "what was left beside that",
            place=fit.source,
            remedy="Fit runs that were taken with the motion computed here",
        )
    left_out: dict[str, str] = {}
    own: dict[str, str] = {}
    for identifier in fit.effects:
        effect = effect_of(identifier, machine, fit.own)
        if reason := why_not(effect):
            left_out[identifier] = f"{reason}; never written"
            continue
        names = [name for name in fit.estimates if name.startswith(f"{identifier}.")]
        changes += [_change(fit, name, held, 0.0) for name in names]
        if identifier in fit.own:
            own[identifier] = fit.own[identifier]
    written = {change.name for change in changes}
    given_up = tuple(name for name in held if name not in written)
    return Proposal(tuple(changes), left_out, own, given_up)


def _check_whole(machine: Machine, fit: SavedFit) -> None:
    """Refuse a fit of another machine, or of a part of its parameters."""
    if fit.machine and not _same_machine(fit.machine, machine):
        raise BadInput(
            f'a fit of the machine "{fit.machine}", the site has "{machine.name}"',
            place=fit.source,
            remedy="Fit runs of this machine",
        )
    missing = [p.name for p in machine.parameters if p.name not in fit.estimates]
    if missing:
        raise BadInput(
            f"{len(missing)} parameters are not in the fit, the first is {missing[0]}",
            place=fit.source,
            remedy="Fit all parameters together: they are correlated",
        )


def _same_machine(said: str, machine: Machine) -> bool:
    """Whether a model's machine is this one; older models hold the path of its file."""
    return said == machine.name or PurePath(said).name == PurePath(machine.source).name


def _not_of_the_machine(effect: str, machine: Machine) -> str:
    """Why nothing of an effect can be in any controller; empty if it is the machine's own."""
    try:
        return why_not(effect_named(effect, machine))
    except BadInput:
        return "an effect of your own: a controller knows nothing of it"


def _change(fit: SavedFit, name: str, held: Mapping[str, float], add_to: float) -> Change:
    found = fit.estimates[name]
    new = found.value + add_to
    if name.startswith("backlash."):
        new = max(new, 0.0)  # lost motion is never negative; below zero it is noise
    return Change(name, held.get(name, 0.0), new, found.sigma, found.unit, found.identified)


def _cyclic(fit: SavedFit, held: Mapping[str, float], left_out: dict[str, str]) -> list[Change]:
    """Turn A sin(2 pi s / p) + B cos(2 pi s / p) into the controller's table of each actuator."""
    effect = "screw-cyclic"
    period = fit.estimates.get(f"{effect}.period")
    legs = [n.split(".")[1] for n in fit.estimates if n.startswith(effect) and n.endswith(".sin")]
    changes: list[Change] = []
    for leg in legs:
        table = f"{effect}-table.{leg}"
        count = sum(n.startswith(f"{table}.") and n != f"{table}.period" for n in held)
        if period is None or not count:
            left_out[effect] = "the controller has no cyclic table"
            return []
        if (fit.compensation or {}).get(f"{table}.period", 0.0) != 0.0:
            left_out[effect] = "the controller's cyclic table was in use meanwhile; undo it first"
            return []
        sine, cosine = (fit.estimates[f"{effect}.{leg}.{part}"] for part in ("sin", "cos"))
        sigma = math.hypot(sine.sigma, cosine.sigma)
        changes.append(
            Change(
                f"{table}.period",
                held[f"{table}.period"],
                period.value,
                period.sigma,
                period.unit,
                True,
            )
        )
        for k in range(count):
            turn = 2.0 * math.pi * k / count
            new = sine.value * math.sin(turn) + cosine.value * math.cos(turn)
            name = f"{table}.{k}"
            changes.append(Change(name, held[name], new, sigma, sine.unit, sine.identified))
    return changes
