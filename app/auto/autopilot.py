"""The loop: decide, keep the decision, carry it out, keep what came of it, decide again."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from app.auto.findings import Findings, look
from app.auto.journal import Decisions
from app.auto.policy import SURE, Decision, Known, Limits, decide
from app.errors import GateRefused
from app.files.pose_table import Pose
from app.jobs.following_up import design
from calib.errors import BadInput

Veto = Callable[[Decision], Awaitable[bool]]
"""Asks the person at the machine whether a decision is to be carried out."""
Tell = Callable[[str], None]
HOPELESS, REFUSED, VETOED = "hopeless", "refused", "vetoed"
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
    veto : coroutine function, optional
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
        veto: Veto | None = None,
        tell: Tell = lambda _: None,
    ) -> None:
        self.folder, self.laboratory, self.veto, self.tell = folder, laboratory, veto, tell
        self.journal = Decisions(folder)
        begun = self.journal.begun
        if begun is None:
            said = {k: v for k, v in asdict(limits).items() if v != math.inf}
            begun = self.journal.write("begun", seed=seed, limits=said)
        self.limits, self.seed = Limits(**begun["limits"]), int(begun["seed"])

    async def run(self) -> Decision:
        """Decide and do until a decision says stop; that one is returned.

        Raises what sessions and write-backs raise; :meth:`run` of a new Autopilot on the same
        folder goes on.
        """
        while True:
            known = await self._known()
            waiting = self.journal.open
            if waiting is not None:
                number, decision = int(waiting["number"]), _decision(waiting)
            else:
                number, decision = len(self.journal.of("decided")) + 1, decide(known, self.limits)
                self.journal.write("decided", number=number, **asdict(decision))
            self.tell(f"{number}. {_does(decision)}: {decision.why}")
            if decision.kind == "stop":
                self.journal.write("done", number=number)
                return decision
            done = await self._asked(number, decision)
            self.journal.write("done", number=number, **done)
            if "says" in done:
                self.tell(f"   {done['says']}")

    async def _asked(self, number: int, decision: Decision) -> dict[str, Any]:
        """Let the person say no; else carry it out."""
        if self.veto is not None and not await self.veto(decision):
            no: dict[str, Any] = {VETOED: True, "says": "not done: the operator said no"}
            if decision.pair is not None:
                no |= {"pair": list(decision.pair), HOPELESS: "the operator said no"}
            return no
        match decision.kind:
            case "measure":
                poses = await self.laboratory.choose(decision.count, self.seed + number)
                return await self._measured(number, poses, decision.why)
            case "tell-apart":
                return await self._told_apart(number, decision)
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

    async def _told_apart(self, number: int, decision: Decision) -> dict[str, Any]:
        """Poses that tell a pair apart, if there are such; else the pair is left in question."""
        assert decision.pair is not None
        one, other = decision.pair
        found = self._found()
        rest = [name for name in found.effects if name not in decision.pair]
        try:
            plan = await asyncio.to_thread(
                design, found.runs, (one, other), decision.count, add=rest, seed=self.seed + number
            )
        except BadInput as error:
            return self._left(decision, str(error))
        now, then = min(plan.right_now.values()), min(plan.right_then.values())
        if then < SURE:
            return self._left(
                decision,
                f"{decision.count} poses would give the right answer with a probability of "
                f"{then:.2f} only ({now:.2f} without them)",
            )
        if differs := found.other_conditions(plan.conditions, PAYLOAD_KG, TEMPERATURE_K):
            if self.veto is None:
                return self._left(decision, f"it needs {differs}, and nobody is there to see to it")
            changed = Decision("measure", f"put it so: {differs}; then go on", decision.count)
            if not await self.veto(changed):
                return self._left(decision, f"it needs {differs}, and the operator said no")
        self.tell(f"   the right answer with a probability of {now:.2f} now, {then:.2f} then")
        title = f"tells {one} from {other}"
        measured = await self._measured(number, plan.by_label(), title)
        # A second set of the same kind would be asked for the same reason: once is decided.
        return {**measured, "pair": [one, other], HOPELESS: "they were measured for once"}

    def _left(self, decision: Decision, why: str) -> dict[str, Any]:
        assert decision.pair is not None
        return {"pair": list(decision.pair), HOPELESS: why, "says": f"left in question: {why}"}

    async def _applied(self) -> dict[str, Any]:
        model = self._found().model
        try:
            left_out = await self.laboratory.apply(Path(model))
        except GateRefused as refused:
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

    def _done(self) -> list[dict[str, Any]]:
        return self.journal.of("done")

    def _runs(self) -> tuple[str, ...]:
        return tuple(line["run"] for line in self._done() if "run" in line)

    def _found(self) -> Findings:
        return Findings.from_json(self.journal.of("found")[-1])

    async def _known(self) -> Known:
        """What the journal says, and what the runs say if they were not asked yet."""
        runs, done = self._runs(), self._done()
        known = Known(
            poses=sum(int(line.get("poses", 0)) for line in done),
            minutes=sum(float(line.get("minutes", 0.0)) for line in done),
            hopeless={tuple(line["pair"]): line[HOPELESS] for line in done if HOPELESS in line},
        )
        if not runs:
            return self._refused(known, done)
        found = self.journal.of("found")
        if not found or tuple(found[-1]["runs"]) != runs:
            seen = await asyncio.to_thread(look, runs, self.folder / f"model-{len(runs):02}.toml")
            self.journal.write("found", **asdict(seen))
            self.tell(f"   {seen.words()}")
        return self._refused(self._with(known, self._found(), done), done)

    def _with(self, known: Known, found: Findings, done: list[dict[str, Any]]) -> Known:
        written = [k for k, line in enumerate(done) if "left_out" in line]
        since = done[written[-1] :] if written else []
        seen = [line for line in since if "verified_um" in line]
        unknown = [line for line in self.journal.of("found") if line["unexplained"]]
        return replace(
            known,
            predicted_um=found.predicted_um,
            ambiguous=tuple((a, b) for a, b in found.ambiguous),
            unexplained=found.unexplained,
            rounds_unknown=max(0, len(unknown) - 1) if found.unexplained else 0,
            verified_um=seen[-1]["verified_um"] if seen else None,
            at_most_um=seen[-1]["at_most_um"] if seen else None,
            applied=bool(written) and done[written[-1]]["model"] == found.model,
            corrections=len(written),
        )

    def _refused(self, known: Known, done: list[dict[str, Any]]) -> Known:
        """What was refused is not asked again with the same readings."""
        last = done[-1] if done else {}
        ended = last.get(REFUSED) or (last.get(VETOED) and HOPELESS not in last)
        return (
            replace(known, ended=str(last.get(REFUSED, "the operator said no"))) if ended else known
        )


def _decision(line: Mapping[str, Any]) -> Decision:
    pair = line["pair"]
    return Decision(
        line["kind"], line["why"], int(line["count"]), tuple(pair) if pair else None,
        line["expected"], line["reached"],
    )  # fmt: skip


def _does(decision: Decision) -> str:
    match decision.kind:
        case "measure":
            return f"measure {decision.count} poses"
        case "tell-apart":
            assert decision.pair is not None
            return f"tell {decision.pair[0]} from {decision.pair[1]}"
        case "apply":
            return "write the correction"
        case "verify":
            return "verify at fresh poses"
        case "stop":
            return "stop"
