"""Accounts of a run tried against one another by whole fits, where the first one leaves trouble.

The hypotheses about places go by how many readings stand in their nests, those about a misfit by
what an optimum leaves. A mistake of some millimetres can deceive both: it passes for another that
explains nearly as much, or bends the geometry until nothing is left to explain. Here each one
begins anew, from the nominal machine, and the account whose fit costs least is the answer.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.identify.fitting import Fit
from calib.look.bent import not_stated
from calib.look.many import several_steps
from calib.look.misfit import each_of_places
from calib.look.places import Places, places_of
from calib.look.proposal import Proposal
from calib.look.refined import refined
from calib.look.scan import excess, fit_together, from_nominal
from calib.look.several import parted
from calib.look.shape import other_shape, stretched
from calib.look.story import Story
from calib.mechanism.description import Machine
from calib.runs.record import Run

ROUNDS = 3
"""Hypotheses that may hold at once."""
LEFT_OUT = 30.0
"""What a reading that is left out costs: far more than one that stays."""
SAID = 100.0
"""What each hypothesis costs."""
BEYOND = 15.0
"""Standard deviations of its tolerance that no machine is off."""
TROUBLED = 30.0
"""Chi-square per degree of freedom from which on physics alone is no likely cause."""
CLEARLY = 0.3
"""Part of the cost of the first account that another may have to be taken for it."""
Hypothesis = Callable[[Places], Proposal | None]


def better_story(
    machine: Machine, run: Run, first: Story, hypotheses: Sequence[Hypothesis], *, alone: bool
) -> Story:
    """The account that costs least, where the first one is troubled; else that one.

    Parameters
    ----------
    machine : Machine
    run : Run
        As its rows alone say.
    first : Story
        The account by places, and by what a fit left.
    hypotheses : sequence
        Those about places, each of which may begin an account.
    alone : bool
        Whether this is the only run.
    """
    judged = with_fit(machine, first)
    if not _troubled(judged):
        return first
    begun = [Story([run], [], {})]
    for propose in hypotheses:
        begun += _begun(machine, run, propose)
    begun += _not_held(machine, run)
    best = judged
    for story in begun:
        found = _gone_on(machine, story, alone=alone)
        if _beats(found, best, part=CLEARLY if best is judged else 1.0):
            best = found
    return best if best is not judged else first


def _beats(one: Story, other: Story, part: float) -> bool:
    """Whether one account is better: it has no trouble where the other has, or costs less.

    ``part``: of the other's cost that it may have, where both have trouble.
    """
    if _bad(one) != _bad(other):
        return _bad(other)
    return _cost(one) < (part if _bad(one) else 1.0) * _cost(other)


def _begun(machine: Machine, run: Run, propose: Hypothesis) -> list[Story]:
    """An account that begins with one hypothesis about places."""
    found = []
    places = places_of(machine, run)
    for view in () if places is None else dict.fromkeys((places, places.strict)):
        proposal = propose(view)
        if proposal is None or proposal.explained < view.standing + 2:
            continue
        meant, remark = proposal.take()
        if remark.name == "station-moved" and not proposal.known:
            continue  # its parts are tried by the first account
        meant = refined(machine, run, meant, remark)
        found.append(Story([meant], [remark], proposal.known))
    return found


def _not_held(machine: Machine, run: Run) -> list[Story]:
    """An account that begins with parameters which the controller did not hold."""
    fitted = fit_together(machine, [run]) if run.header.controller_parameters else None
    mended = None if fitted is None else not_stated(machine, run, fitted)
    return [] if mended is None else [Story([mended.run], [mended.remark], {})]


def _gone_on(machine: Machine, story: Story, *, alone: bool) -> Story:
    """The account with what explains the rest of its misfit, hypothesis by hypothesis."""
    best = with_fit(machine, story)
    while len(best.remarks) < ROUNDS and len(best.parts) == 1 and not best.known and _bad(best):
        run = best.parts[0]
        view = from_nominal(machine, [run])
        if view is None:
            break
        tried = each_of_places(machine, run, view, alone=alone)
        for mended in (stretched(run), other_shape(machine, run)):
            if mended is not None:
                tried.append(Story([mended.run], [mended.remark], {}))
        parts = parted(machine, run) if alone and not best.remarks else None
        if parts is not None:
            tried.append(Story(parts[0], [parts[1]], {}))
        steps = several_steps(machine, run) if alone else None
        if steps is not None:
            tried.append(Story(*steps, {}))
        judged = [
            with_fit(machine, replace(one, remarks=[*best.remarks, *one.remarks])) for one in tried
        ]
        next_ = min(judged, key=_cost, default=best)
        if not _beats(next_, best, part=CLEARLY):
            break
        best = next_
    return best


def with_fit(machine: Machine, story: Story) -> Story:
    """The account with the fit that judges it."""
    if story.fit is not None:
        return story
    return replace(story, fit=fit_together(machine, story.parts, story.known))


def _cost(story: Story) -> float:
    """What an account costs: misfit, bent geometry, readings left out, hypotheses."""
    fitted = story.fit
    if fitted is None:
        return np.inf
    return excess(fitted) + LEFT_OUT * len(fitted.bad) + SAID * len(story.remarks)


def _troubled(story: Story) -> bool:
    return _bad(story) or len(story.remarks) > 1


def bears_out(story: Story) -> bool:
    """Whether the fit of an account leaves no trouble in the record."""
    return not _bad(story)


def _bad(story: Story) -> bool:
    """Whether a fit says that its record is not what was measured."""
    fitted = story.fit
    if fitted is None:
        return True
    out = len(fitted.bad) > max(3, 0.03 * (fitted.readings + len(fitted.bad)))
    return out or fitted.chi2_per_dof > TROUBLED or bool(np.any(np.abs(_off(fitted)) > BEYOND))


def _off(fitted: Fit) -> Array:
    """How far (P,) each parameter is off, in standard deviations of its tolerance."""
    free = fitted.model.free.size
    return np.asarray((fitted.values - fitted.model.centre)[:free] / fitted.model.prior[:free])
