"""How long the steps of a session take, kind by kind, and what that says of those that are left."""

from collections.abc import Sequence

from app.session.plan import Step

KNOWN = 0.5
"""Part of what is left that must be of kinds that were done: before, nothing is said."""


class Pace:
    """Mean times of the steps done since the session began, or was taken over.

    Kinds differ by decades (a look at a list, a move, an SMR that is carried), and what is done
    first is not what comes then: a mean over all would promise anything.
    """

    def __init__(self) -> None:
        self._spent: dict[str, list[float]] = {}

    def took(self, step: Step, seconds: float) -> None:
        """Take note of a step that has ended."""
        self._spent.setdefault(step.kind.name, []).append(seconds)

    def left(self, due: Sequence[Step]) -> float | None:
        """Wall seconds that these steps will take; None while too little is known."""
        known = [self._mean(step.kind.name) for step in due if step.kind.name in self._spent]
        if not due:
            return 0.0
        if len(known) < KNOWN * len(due):
            return None
        return sum(known) * len(due) / len(known)

    def _mean(self, kind: str) -> float:
        spent = self._spent[kind]
        return sum(spent) / len(spent)
