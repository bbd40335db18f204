"""The loop: decide, keep the decision, carry it out, keep what came of it, decide again."""

import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from app.auto.aside import aside
from app.auto.decision import Decision, Known, Limits
from app.auto.findings import Findings, look
from app.auto.journal import Decisions
from app.auto.known import HOPELESS, REFUSED, VETOED, WAITED, known_by, runs_of
from app.auto.policy import SURE, decide, others
from app.auto.wording import GO, SKIP, STOP, counted, decision_of, in_words, typed_of
from app.errors import GateRefused, StoppedByOperator
from app.files.pose_table import Pose
from app.jobs.following_up import FollowUpReport, design
from calib.errors import BadInput

Ask = Callable[[str, tuple[str, ...], str], Awaitable[str]]
"""Puts a question with its answers to the person at the machine; returns one of them.

The third says what may be answered in other words; empty: nothing.
"""
Tell = Callable[[str], None]
LEAVE = "leave it"
SAID = "the operator said no"
PAYLOAD_KG, TEMPERATURE_K = 0.05, 1.0
"""How near a condition must be to how it is now, to count as being so."""


class Laboratory(Protocol):
    """What carries decisions out: a station with its machine, or a simulated one."""

    async def choose(self, count: int, seed: int) -> Mapping[str, Pose]:
        """Poses for accuracy, label -> x, y, z (mm), rx, ry, rz (rad)."""

    async def measure(
        self, poses: Mapping[str, Pose], title: str, began: Callable[[str], None], again: str | None
    ) -> tuple[str, float]:
        """Measure poses, or go on with session ``again``: the run's folder, minutes it took."""

    async def warm_up(
        self, minutes: float, began: Callable[[str], None], again: str | None
    ) -> float:
        """Keep the machine moving, or go on with session ``again``: the minutes it took."""

    async def apply(self, model: Path) -> Mapping[str, str]:
        """Write a model through the gates; what was left out, and why."""

    async def verify(self, began: Callable[[str], None], again: str | None) -> "Seen":
        """What fresh poses show."""


@dataclass(frozen=True)
class Seen:
    """RMS position error at fresh poses in um without the tracker's part.

    ``at_most_um``: its upper limit at 95 %; ``minutes`` of machine time that it took to see.
    """

    own_um: float
    at_most_um: float
    minutes: float


@dataclass(frozen=True)
class Apart:
    """Poses that tell a pair apart, or why there are none."""

    plan: FollowUpReport | None
    why_not: str = ""


class Autopilot:
    """One unattended (or watched) calibration in a folder of its own.

    Parameters
    ----------
    folder : Path
        Journal of decisions, poses, models; it is there.
    laboratory : Laboratory
    limits : Limits
        Of a folder that was begun earlier those of the journal stand.
    seed : int
        Draws the candidates for poses.
    ask : coroutine function, optional
        Asked before every decision is carried out; nobody is if None.
    tell : callable
        Told, in a line, what is decided and what came of it.
    """

    def __init__(
        self,
        folder: Path,
        laboratory: Laboratory,
        limits: Limits,
        seed: int = 1,
        ask: Ask | None = None,
        tell: Tell = lambda _: None,
    ) -> None:
        self.folder, self.laboratory, self.ask, self.tell = folder, laboratory, ask, tell
        self.journal = Decisions(folder)
        begun = self.journal.begun
        if begun is None:
            said = {k: v for k, v in asdict(limits).items() if v != math.inf}
            begun = self.journal.write("begun", seed=seed, limits=said)
        self.limits, self.seed = Limits(**begun["limits"]), int(begun["seed"])
        self._apart: tuple[int, Apart] | None = None

    async def run(self) -> Decision:
        """Decide and do until a decision says stop; that one is returned.

        Raises what sessions and write-backs raise, and StoppedByOperator where the person said
        stop; :meth:`run` of a new Autopilot on the same folder goes on.
        """
        while True:
            known = await self._known()
            number, decision = await self._next(known)
            self.tell(f"{number}. {in_words(decision)}")
            if decision.kind == "stop":
                self.journal.write("done", number=number)
                return decision
            wanted = await self._agreed(number, decision, known)
            if wanted is None:
                continue
            number, decision = wanted
            done = await self._carried_out(number, decision)
            self._done(number, **done)

    async def _next(self, known: Known) -> tuple[int, Decision]:
        """The decision that was not carried out to its end, or a new one, on the disk."""
        waiting = self.journal.open
        if waiting is not None:
            return int(waiting["number"]), decision_of(waiting)
        return await self._decided(decide(known, self.limits))

    async def _decided(self, decision: Decision) -> tuple[int, Decision]:
        """Keep a decision with what is expected of it."""
        number = len(self.journal.of("decided")) + 1
        if decision.kind == "tell-apart":
            plan = (await self._designed(number, decision)).plan
            if plan is not None:
                right = {"right_now": _least(plan.right_now), "right_then": _least(plan.right_then)}
                decision = replace(decision, expected=right)
        self.journal.write("decided", number=number, **asdict(decision))
        return number, decision

    def _done(self, number: int, **done: Any) -> None:
        self.journal.write("done", number=number, **done)
        if "says" in done:
            self.tell(f"   {done['says']}")

    # the person's part

    async def _agreed(
        self, number: int, decision: Decision, known: Known
    ) -> tuple[int, Decision] | None:
        """Let the person say go, skip, stop, or choose something else; None: nothing is done."""
        hopeless = (
            decision.kind == "tell-apart" and (await self._designed(number, decision)).why_not
        )
        if self.ask is None or hopeless or self.journal.session_of(number) is not None:
            return number, decision
        choices = {f"{one.words()} instead": one for one in others(known, self.limits, decision)}
        typed = typed_of(decision)
        given = await self.ask(in_words(decision), (GO, SKIP, *choices, STOP), typed)
        if given == GO:
            return number, decision
        if given == STOP:
            raise StoppedByOperator(
                f"stopped before decision {number} was carried out",
                remedy=f"Go on with the folder {self.folder}",
            )
        if given == SKIP:
            self._done(number, **_vetoed(decision))
            return None
        chosen = choices.get(given) or counted(decision, given)
        if chosen is None:
            raise BadInput(f"{given!r} is no answer", remedy=f"Answer one of: {GO}, {SKIP}, {STOP}")
        self._done(number, replaced=True, says=f"the operator chose: {chosen.words()}")
        return await self._decided(chosen)

    # what is done

    async def _carried_out(self, number: int, decision: Decision) -> dict[str, Any]:
        match decision.kind:
            case "measure":
                poses = await self.laboratory.choose(decision.count, self.seed + number)
                return await self._measured(number, poses, decision.why)
            case "tell-apart":
                return await self._told_apart(number, decision)
            case "warm-up":
                return await self._warmed_up(number, decision)
            case "apply":
                return await self._applied()
            case _:
                return await self._verified(number)

    async def _measured(self, number: int, poses: Mapping[str, Pose], title: str) -> dict[str, Any]:
        run, minutes = await self.laboratory.measure(
            poses, title, self._began(number), self.journal.session_of(number)
        )
        says = f"{len(poses)} poses in {minutes:.0f} min of machine time: {run}"
        return {"run": run, "poses": len(poses), "minutes": minutes, "says": says}

    def _began(self, number: int) -> Callable[[str], None]:
        def began(session: str) -> None:
            self.journal.write("session", number=number, session=session)

        return began

    async def _designed(self, number: int, decision: Decision) -> Apart:
        """Poses that tell a pair apart, designed once for each decision."""
        if self._apart is None or self._apart[0] != number:
            self._apart = number, await self._design(number, decision)
        return self._apart[1]

    async def _design(self, number: int, decision: Decision) -> Apart:
        assert decision.pair is not None
        found = self._found()
        rest = [name for name in found.effects if name not in decision.pair]
        try:
            plan = await aside(
                partial(
                    design, found.runs, decision.pair, decision.count, add=rest,
                    seed=self.seed + number,
                )
            )  # fmt: skip
        except BadInput as error:
            return Apart(None, str(error))
        now, then = _least(plan.right_now), _least(plan.right_then)
        if then < SURE:
            why = f"would give the right answer with a probability of {then:.2f} only"
            return Apart(plan, f"{decision.count} poses {why} ({now:.2f} without them)")
        return Apart(plan)

    async def _told_apart(self, number: int, decision: Decision) -> dict[str, Any]:
        """Measure poses that tell a pair apart; else the pair is left in question."""
        assert decision.pair is not None
        one, other = decision.pair
        apart = await self._designed(number, decision)
        if apart.plan is None or apart.why_not:
            return self._left(decision, apart.why_not)
        wanted = apart.plan.conditions
        if differs := self._found().other_conditions(wanted, PAYLOAD_KG, TEMPERATURE_K):
            if self.ask is None:
                return self._left(decision, f"it needs {differs}, and nobody is there to see to it")
            if await self.ask(f"put it so: {differs}", ("done", LEAVE), "") != "done":
                return self._left(decision, f"it needs {differs}, and {SAID}")
        title = f"tells {one} from {other}"
        measured = await self._measured(number, apart.plan.by_label(), title)
        # A second set of the same kind would be asked for the same reason: once is decided.
        return {**measured, "pair": [one, other], HOPELESS: "they were measured for once"}

    def _left(self, decision: Decision, why: str) -> dict[str, Any]:
        assert decision.pair is not None
        return {"pair": list(decision.pair), HOPELESS: why, "says": f"left in question: {why}"}

    async def _warmed_up(self, number: int, decision: Decision) -> dict[str, Any]:
        minutes = await self.laboratory.warm_up(
            decision.minutes, self._began(number), self.journal.session_of(number)
        )
        says = f"kept moving for {minutes:.0f} min"
        return {"minutes": minutes, WAITED: True, "says": says}

    async def _applied(self) -> dict[str, Any]:
        model = self._found().model
        try:
            left_out = await self.laboratory.apply(Path(model))
        except GateRefused as refused:
            if refused.nothing_to_gain:  # as it stands it is what fresh poses are to judge
                says = "left as it is: what the machine holds is as good as what was found"
                return {"model": model, "left_out": {}, "says": says}
            return {REFUSED: str(refused), "says": f"not written: {refused}"}
        lacks = "".join(f"; not written: {name} ({why})" for name, why in left_out.items())
        return {"model": model, "left_out": dict(left_out), "says": f"written and kept{lacks}"}

    async def _verified(self, number: int) -> dict[str, Any]:
        seen = await self.laboratory.verify(self._began(number), self.journal.session_of(number))
        return {
            "verified_um": seen.own_um,
            "at_most_um": seen.at_most_um,
            "minutes": seen.minutes,
            "says": f"fresh poses: {seen.own_um:.1f} um RMS without the tracker's part, "
            f"at most {seen.at_most_um:.1f} um (95 %)",
        }

    # what is known

    def _found(self) -> Findings:
        return Findings.from_json(self.journal.of("found")[-1])

    async def _known(self) -> Known:
        """What the journal says, and what the runs say if they were not asked yet."""
        runs = runs_of(self.journal)
        found = self.journal.of("found")
        if runs and (not found or tuple(found[-1]["runs"]) != runs):
            model = self.folder / f"model-{len(runs):02}.toml"
            seen = await aside(partial(look, runs, model))
            self.journal.write("found", **asdict(seen))
            self.tell(f"   {seen.words()}")
        return known_by(self.journal)


def _vetoed(decision: Decision) -> dict[str, Any]:
    no: dict[str, Any] = {VETOED: True, "ground": decision.ground, "says": f"not done: {SAID}"}
    if decision.pair is not None:
        no |= {"pair": list(decision.pair), HOPELESS: SAID}
    return no


def _least(right: Mapping[str, float]) -> float:
    return min(right.values())
