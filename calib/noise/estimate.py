"""Which components of noise the readings demand: restricted maximum likelihood.

Components join one by one while the likelihood rises by enough; so noise that a missing effect
imitates is not taken for one where that effect's columns are among those of the fit. Of what the
scatter of the readings may hang on (see :mod:`calib.noise.scatter`) only those are tried that a
score test points to; what they gain is judged against the tails that the readings have, and against
the best of as many by chance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.chance import chi2_above
from calib.evidence.problem import LinearProblem
from calib.noise.component import WHITE, Noise, Taking
from calib.noise.likelihood import Likelihood, spread
from calib.noise.scatter import ACROSS, ALONG, tails, uneven
from calib.noise.score import promising
from calib.noise.sizes import FAINT, Sizes, joined, settled

DEMANDED = 1.5
"""Rise of the log likelihood from which a component counts in judging what else is missing."""
RESCALED = 4.8
"""The same of the scale of the stated sigmas: these are trusted unless clearly wrong."""
UNEVEN = 5.41
"""The same of one component of scatter (p 0.001); of many, more by the log of how many."""
SHARED = 2.0
"""The same of a white part beside the correlated one."""
FADING, WANDERING = ("correlated", "successive"), ("walk", "walk-by-row")
"""What goes on in time, or from row to row: it fades, or wanders without end, where some fades."""
TIED = (*FADING, *WANDERING)
"""One or the other."""
PARTS = (*TIED, "visit", "scale")
SAID = {"successive": "correlated", "walk-by-row": "walk"}
CLOSEST = 2
"""Components for which all sizes are found together, of those that would join: the likeliest."""
POINTED, TRIED = 2.5, 2
"""Standard deviations of the score from which a component of scatter is tried; how many at most."""


@dataclass(frozen=True)
class Component:
    """A component of the noise.

    ``name`` correlated, walk, visit, scale, or one of :class:`calib.noise.scatter.Scatter`;
    ``value`` s, stated sigmas from one reading to the next, usual errors, a ratio (of a group or
    direction: over what is stated, the overall scale in it), um, arcsec, or um per metre;
    ``sigma`` standard uncertainty of the value; ``p_value`` of having none.
    """

    name: str
    value: float
    sigma: float
    p_value: float


@dataclass(frozen=True)
class Found:
    """What noise the readings demand.

    ``gain`` is the rise of the log likelihood by all of it, ``price`` what its freedom does by
    chance.
    """

    noise: Noise = WHITE
    gain: float = 0.0
    components: tuple[Component, ...] = ()
    price: float = 0.0


def estimate(problem: LinearProblem, taking: Taking) -> Found:
    """Find the components of noise that the residual of a fit demands.

    Parameters
    ----------
    problem : LinearProblem
        A fit over A readings' three components (axis after axis), in stated sigmas.
    taking : Taking
    """
    likelihood = Likelihood(problem, taking)
    bar = _Bar(likelihood)
    now = white = Sizes((), (), likelihood.of(WHITE))
    gains: dict[str, float] = {}
    found = promising(*likelihood.left(WHITE), taking)
    left = [part for part in PARTS if ("time" if part in TIED else part) in found]
    while True:
        fading = [part for part in left if part not in WANDERING]
        offers = {part: joined(likelihood, now, part) for part in fading}
        if any(now.value - offers[part].value > DEMANDED for part in FADING if part in offers):
            offers |= {part: joined(likelihood, now, part) for part in WANDERING}
        plain = tuple(offers)
        offers |= {part: joined(likelihood, now, part) for part in _pointed(likelihood, now, bar)}
        if now.parts:
            first = sorted(offers, key=lambda part: offers[part].value + bar.price(part))
            offers |= {part: settled(likelihood, offers[part]) for part in first[:CLOSEST]}
        rise = {part: now.value - offer.value for part, offer in offers.items()}
        over = {
            part: rise[part] - bar.price(part)
            for part, offer in offers.items()
            if bar.passed(part, offer, rise[part])
        }
        if not over:
            break
        best = max(over, key=lambda part: over[part])
        now, gains[best] = offers[best], rise[best]
        taken = TIED if best in TIED else (best,)
        left = [part for part in plain if part not in taken and rise[part] > FAINT]
    if set(FADING) & set(now.parts):
        wider = settled(likelihood, joined(likelihood, now, "share"))
        now = wider if now.value - wider.value > SHARED else now
    now = _pruned(likelihood, now, bar)
    if not now.parts:
        return Found()
    components = _components(likelihood, now, gains, bar)
    price = DEMANDED * len(components) + bar.chosen * len(bar.own(now.parts))
    noise = likelihood.noise(now.parts, now.logs)
    return Found(noise, white.value - now.value, components, price)


def points_to_scatter(problem: LinearProblem, taking: Taking) -> float:
    """p-value of the score test that all readings scatter alike, whatever they state; no search."""
    likelihood = Likelihood(problem, taking)
    if not likelihood.uneven:
        return 1.0
    far = uneven(*likelihood.left(WHITE), taking.scatter, likelihood.uneven, taking.live)
    return min(1.0, far.size * math.erfc(float(np.max(np.abs(far))) / math.sqrt(2.0)))


class _Bar:
    """How much a component must raise the likelihood."""

    def __init__(self, likelihood: Likelihood) -> None:
        self._likelihood = likelihood
        self._uneven = frozenset(likelihood.uneven)
        self.chosen = math.log(max(len(self._uneven), 1))

    def own(self, parts: Sequence[str]) -> list[str]:
        """Those that are of single readings' scatter."""
        return [part for part in parts if part in self._uneven]

    def passed(self, part: str, offer: Sizes, rise: float) -> bool:
        """Whether a component counts that has led to ``offer`` by such a rise."""
        if part not in self._uneven:
            return rise > self._needed(part)
        needed = UNEVEN + self.chosen
        return rise > needed and rise > needed * self.heavy(offer)

    @staticmethod
    def _needed(part: str) -> float:
        return RESCALED if part == "scale" else DEMANDED

    def price(self, part: str) -> float:
        """What a rise counts less by, where several components would do."""
        return DEMANDED + self.chosen if part in self._uneven else self._needed(part)

    def heavy(self, sizes: Sizes) -> float:
        """Variance of the readings' squares over that of normal ones."""
        return tails(self._likelihood.residual(self._likelihood.noise(sizes.parts, sizes.logs)))

    def chance(self, part: str, gain: float, heavy: float) -> float:
        """Probability of such a rise where there is none of it.

        Chi-square of one; from its edge where a size can only be positive.
        """
        if part not in self._uneven:
            return float(0.5 * chi2_above(1.0, 2.0 * gain))
        sides = 0.5 if self._likelihood.taking.scatter.is_added(part) else 1.0
        return min(1.0, len(self._uneven) * sides * float(chi2_above(1.0, 2.0 * gain / heavy)))


def _pointed(likelihood: Likelihood, now: Sizes, bar: _Bar) -> list[str]:
    """Components of scatter that a score test points to, beside what there is.

    Along and across the beam it says the same with another sign: they count for one.
    """
    names = [part for part in likelihood.uneven if part not in now.parts]
    if not names:
        return []
    scatter = likelihood.taking.scatter
    residual, absorbed = likelihood.left(likelihood.noise(now.parts, now.logs))
    far = uneven(residual, absorbed, scatter, names, likelihood.taking.live)
    told = [
        float(one) if scatter.is_added(name) else abs(float(one))
        for name, one in zip(names, far, strict=True)
    ]
    found: list[str] = []
    for k in np.argsort(-np.array(told), kind="stable"):
        twins = {ALONG, ACROSS} == {names[k], *found[-1:]}
        if told[k] > POINTED and (twins or len(set(found) - {ACROSS}) < TRIED):
            found.append(names[k])
    return found


def _pruned(likelihood: Likelihood, now: Sizes, bar: _Bar) -> Sizes:
    """Without the overall scale, or one of scatter, that others have made superfluous."""
    own = [part for part in now.parts if part == "scale" or part in bar.own(now.parts)]
    for part in own if len(own) > 1 else ():
        less = settled(likelihood, now.without(likelihood, part))
        if not bar.passed(part, now, less.value - now.value):
            now = less
    return now


def _components(
    likelihood: Likelihood, now: Sizes, gains: dict[str, float], bar: _Bar
) -> tuple[Component, ...]:
    """Values with uncertainties from the curvature of log L, and p by the likelihood ratio.

    Uncertainties of scatter are as much larger as tails make them.
    """
    sums = np.eye(len(now.parts))
    if "scale" in now.parts:
        for part in bar.own(now.parts):
            sums[now.parts.index(part), now.parts.index("scale")] = 1.0
    noise, own = likelihood.noise(now.parts, now.logs), bar.own(now.parts)
    heavy = bar.heavy(now) if own else 1.0
    relative = spread(likelihood, now.parts, now.logs, sums)
    values = dict(noise.scatter) | {
        "correlated": noise.tau_s,
        "successive": noise.tau_s,
        "walk": noise.step,
        "walk-by-row": noise.step,
        "visit": noise.visit,
        "scale": noise.narrow,
    }
    values |= {part: values[part] * noise.narrow for part in own}
    wider = {part: math.sqrt(heavy) for part in own}
    return tuple(
        Component(
            SAID.get(part, part),
            values[part],
            float(values[part] * relative[k] * wider.get(part, 1.0)),
            bar.chance(part, gains[part], heavy),
        )
        for k, part in enumerate(now.parts)
        if part in values
    )
