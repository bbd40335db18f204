"""A fit judged before it is believed: readings left out, sizes and signs that no machine has."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import IntArray
from calib.digits import length, plus_minus
from calib.effects.component import Effect
from calib.identify.fitting import Fit
from calib.identify.readings import MASKED, BadReading
from calib.identify.starting import MOVED
from calib.identify.taking import noise_covariance
from calib.look.carried import as_fitted
from calib.look.places import PART
from calib.look.strays import groups
from calib.runs.remark import Remark, lines_in_words, ranges
from calib.unknown import Estimate, estimates_of

HALF = 0.5
"""Part of a nest's or a pose's readings that may be left out."""
FEW = 2
"""Readings of a nest or a pose that may always be left out."""
CLEAR = 5.0
"""Sigmas from which on a sign or a size is no chance."""
NOTICEABLE = 0.2
"""Part of its usual size from which on a sign counts."""
TOO_LARGE = 300.0
"""Times its usual size that no machine has; and the part of it that nobody can have seen."""
STRAY = 23.5
"""Squared sigmas, of three components, beyond which a reading is a stray (p = 3e-5)."""
NOBODY = 400.0
"""Chi-square per degree of freedom that no fit has that could be meant."""
BEYOND = 20.0
"""Standard deviations of its tolerance that no machine is off."""


def record_of(fitted: Fit) -> tuple[Remark, ...]:
    """What is said first of a fit: of the record, of the readings left out, of sizes and signs."""
    together = groups(fitted)
    return _or_unexplained(
        fitted,
        *(as_fitted(remark, fitted) for remark in fitted.model.rows.remarks),
        *(group.remark for group in together),
        *_left_out(fitted, {row for group in together for row in group.rows}),
        *_geometry(fitted),
        *(
            remark
            for effect, found in _estimates(fitted)
            for remark in judged(effect, found, fitted)
        ),
    )


def _or_unexplained(fitted: Fit, *found: Remark) -> tuple[Remark, ...]:
    """What was found; and where that leaves a fit that nobody can mean, that it does."""
    scatter = fitted.chi2_per_dof
    if not scatter > NOBODY or not settled(found):
        return found
    several = len(fitted.model.rows.runs) > 1
    alone = "Fit each run alone: if each is explained, they are of several machines. " * several
    apart = float(np.sqrt(np.mean(np.sum(fitted.linear.residual[:, fitted.accepted] ** 2, axis=0))))
    return (
        *found,
        Remark(
            "misfit-unexplained",
            f"The readings are off by {length(apart)} (RMS), {np.sqrt(scatter):.0f} times what is "
            "stated of them: the record, or the machine, is not what the files say",
            (),
            "No single mistake of those that are tried explains it, and no machine within its "
            "tolerances",
            "Fitted as it stands; it is not called adequate",
            alone + "See the nest tables, q, whether anything was moved, and sx, sy, sz; then ask "
            "discover what the residual depends on",
            False,
            fitted.model.rows.runs[0].source,
        ),
    )


def settled(remarks: Sequence[Remark]) -> bool:
    """Whether an analysis can be taken as it is."""
    return all(remark.settled for remark in remarks)


def _left_out(fitted: Fit, explained: Collection[int]) -> Iterator[Remark]:
    """More readings excluded than strays are, beside those explained: never silently."""
    left = [one for one in fitted.bad if one.why != MASKED and one.row not in explained]
    bad = _beyond_noise(fitted, left)
    if not bad:
        return
    rows = fitted.model.rows
    out = np.array(sorted(reading.row for reading in bad), dtype=np.intp)
    part = out.size / (fitted.readings + out.size)
    groups = _mostly_out(fitted, out)
    if (part <= PART or out.size <= FEW) and not groups:
        return
    run = rows.runs[bad[0].run]
    lines = ranges(rows.line[out], rows.line[rows.run == bad[0].run])
    of = f", most of {groups[0]}" if groups else ""
    yield Remark(
        "many-excluded",
        f"{out.size} of {fitted.readings + out.size} readings ({100 * part:.0f} %) are excluded"
        f"{of}: {_why(bad)}{_of_one_nest(fitted, out)}",
        lines,
        f"Excluded: {lines_in_words(lines)}",
        "The fit is of the other readings; it is not called adequate",
        "See these lines: the column nest, the nest table, q, and whether anything moved",
        False,
        run.source,
    )


def _beyond_noise(fitted: Fit, bad: Sequence[BadReading]) -> list[BadReading]:
    """Those that are strays by the noise that was found, too: one nest may scatter more."""
    noise = replace(fitted.noise, scale=fitted.noise.narrow)
    if noise.scale == 1.0 and not noise.scatter:
        return list(bad)
    rows = np.array([one.row for one in bad], dtype=np.intp)
    which = np.zeros(fitted.accepted.size, dtype=bool)
    which[rows] = True
    spread = np.moveaxis(noise_covariance(fitted.linear, noise, which), -1, 0)
    off = fitted.linear.whitened[:, which].T
    squares = np.einsum("ni,ni->n", off, np.linalg.solve(spread, off[:, :, None])[:, :, 0])
    beyond = set(np.flatnonzero(which)[squares > STRAY].tolist())
    return [one for one in bad if one.row in beyond]


def _mostly_out(fitted: Fit, out: IntArray) -> list[str]:
    """Nests and poses of which more than half, and more than a few readings, are left out."""
    rows = fitted.model.rows
    found = []
    for kind, names in (("nest", rows.nest_name), ("pose", rows.pose_name)):
        total = Counter(zip(rows.run, names, strict=True))
        gone = Counter((int(rows.run[row]), names[row]) for row in out)
        for (run, name), count in gone.most_common():
            if name and count > FEW and count > HALF * total[(run, name)]:
                found.append(f"{kind} {name}")
    return found


def _why(bad: Sequence[BadReading]) -> str:
    """What most of them are, in words."""
    other = [reading.why for reading in bad if reading.why.startswith("reads as")]
    if 2 * len(other) > len(bad):
        return f"they stand in other nests ({Counter(other).most_common(1)[0][0]})"
    if 2 * sum(MOVED in reading.why for reading in bad) > len(bad):
        return "they moved as one, as if the tracker or the base had been moved"
    if 2 * sum("no other nest" in reading.why for reading in bad) > len(bad):
        return (
            "they stand in no nest; wrong numbers in q, in the nest table or in x, y, z would "
            "look like this"
        )
    return "they are far from where they should be, each by itself"


def _of_one_nest(fitted: Fit, out: IntArray) -> str:
    """What strays have in common, where all are readings of one nest."""
    names = {fitted.model.rows.nest_name[row] for row in out}
    return f", all of nest {names.pop()}" if len(names) == 1 and out.size > FEW else ""


def _geometry(fitted: Fit) -> Iterator[Remark]:
    """Parameters that no machine within its tolerances can have."""
    model = fitted.model
    off = (fitted.values - model.centre)[: model.free.size] / model.prior[: model.free.size]
    far = np.flatnonzero(np.abs(off) > BEYOND)
    if far.size == 0:
        return
    worst = far[np.argsort(-np.abs(off[far]))]
    told = ", ".join(
        f"{model.names[k]} is off by {fitted.values[k] - model.centre[k]:+.3g} "
        f"{model.machine.parameters[model.free[k]].unit}"
        for k in worst[:3]
    )
    more = f" and {far.size - 3} more" if far.size > 3 else ""
    remedy = (
        "Check the frame and the units of [nests.platform] and [nests.base], the controller's "
        "parameters, and the machine"
    )
    if far.size == 1:  # a table that is off bends many
        k = int(worst[0])
        unit = model.machine.parameters[model.free[k]].unit
        remedy = (
            f"Check {model.names[k]} in the machine file first: it says {model.centre[k]:.7g} "
            f"{unit}, the readings {fitted.values[k]:.7g} {unit}; then the controller, "
            "and the machine"
        )
    yield Remark(
        "geometry-impossible",
        f"No machine within its tolerances is like this: {told}{more}",
        (),
        f"That is {np.abs(off[worst[0]]):.0f} times the standard deviation of its tolerance",
        "Fitted as it stands; it is not called adequate",
        remedy,
        False,
        model.rows.runs[0].source,
    )


def _estimates(fitted: Fit) -> Iterator[tuple[Effect, Sequence[Estimate]]]:
    """Effects of a model with what was found for them, but for those that the record shows."""
    model = fitted.model
    at = model.free.size
    for effect, group in zip(model.effects, model.unknowns, strict=True):
        here = slice(at, at + len(group))
        at += len(group)
        if effect.id not in model.rows.known:
            yield effect, estimates_of(group, fitted.values[here], fitted.sigmas[here])


def judged(effect: Effect, found: Sequence[Estimate], fitted: Fit) -> Iterator[Remark]:
    """A sign or a size that no machine has is a mistake in the record first."""
    scatter = float(np.sqrt(max(1.0, fitted.chi2_per_dof)))
    clear = [
        one
        for one in found
        if not one.unknown.nonlinear and abs(one.value) > CLEAR * scatter * one.sigma
    ]
    source = fitted.model.rows.runs[0].source
    measured = bool({*effect.channels, *effect.depends} & set(fitted.model.rows.channels))
    for one in clear:
        size = one.unknown.size
        told = f"{one.name} = {plus_minus(one.value, one.sigma, one.unit)}"
        if effect.wrong_sign and one.value < -NOTICEABLE * size:
            yield _mistake("sign-impossible", effect, told, effect.wrong_sign, "negative", source)
        elif abs(one.value) > TOO_LARGE * size:
            yield _mistake("size-impossible", effect, told, _units(effect), "too large", source)
        elif measured and abs(one.value) < size / TOO_LARGE:
            yield _mistake("size-impossible", effect, told, _units(effect), "too small", source)
        else:
            continue
        return


def forbidden(effect: Effect, found: Sequence[Estimate]) -> str:
    """The value that physics forbids, in words, if the clearest unknown has the wrong sign."""
    linear = [one for one in found if not one.unknown.nonlinear and one.sigma > 0.0]
    if not effect.wrong_sign or not linear:
        return ""
    clearest = max(linear, key=lambda one: abs(one.value) / one.sigma)
    if clearest.value >= 0.0:
        return ""
    return f"{clearest.name} = {plus_minus(clearest.value, clearest.sigma, clearest.unit)}"


def _units(effect: Effect) -> str:
    return effect.wrong_size or "a unit in the file is not what its column says"


def _mistake(
    name: str, effect: Effect, told: str, hypothesis: str, what: str, source: str
) -> Remark:
    return Remark(
        name,
        f"{told} cannot be: it is {what}. Most likely {hypothesis}",
        (),
        f"No machine has such a {effect.id}",
        "In the model as it was found; it is not called adequate",
        f"Check that first: {hypothesis}",
        False,
        source,
    )
