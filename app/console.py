"""A session on the command line: progress and alarms on standard error, prompts answered there."""

import asyncio
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn

from app.answer import interactive
from app.lasting import write_to_nobody
from app.plain_data import printable
from app.session import events as ev
from app.session.kinds import KINDS
from app.session.session import Outcome, Session
from app.show.spans import duration

STOPS = ("SIGINT", "SIGTERM", "SIGHUP")


class ConsoleFace:
    """Watches a session's events and talks to the person at the terminal."""

    def __init__(self, answer: Callable[[str, str], None], total: int, *, quiet: bool) -> None:
        self._answer = answer
        self._often = False
        """Whether the step in work is of a kind that is too frequent to tell each end."""
        self._console = Console(stderr=True, quiet=quiet, highlight=False, soft_wrap=True)
        self._progress = Progress(
            TextColumn("{task.completed:.0f} of {task.total:.0f}"),
            BarColumn(bar_width=24),
            TextColumn("{task.fields[left]}"),
            TextColumn("{task.description}", markup=False),
            console=self._console,
            transient=True,
            disable=quiet or not self._console.is_terminal,
        )
        self._task: TaskID = self._progress.add_task("", total=total, left="")
        self._total = total
        self._asking: set[asyncio.Task[None]] = set()

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Show the progress bar meanwhile."""
        with self._progress:
            yield

    def hear(self, event: ev.Event) -> None:
        """Take one event."""
        match event:
            case ev.StepStarted(says=says, kind=kind):
                self._often = KINDS[kind].often
                self._progress.update(self._task, description=printable(says))
            case ev.Progress(done=done, total=total, remaining_s=remaining):
                left = "" if remaining is None else f"{duration(remaining)} left"
                self._progress.update(self._task, completed=done, total=total, left=left)
                self._total = total
            case ev.PromptNeeded():
                asking = asyncio.create_task(self._ask(event))
                self._asking.add(asking)
                asking.add_done_callback(self._asking.discard)
            case ev.StepDone() if self._often:
                pass
            case _:
                words = _words(event, self._total)
                if words:
                    self._console.print(printable(words), markup=False)

    async def _ask(self, prompt: ev.PromptNeeded) -> None:
        self._progress.stop()
        instead = f", or {prompt.typed}" if prompt.typed else ""
        text = f"{printable(prompt.text)} ({'/'.join(prompt.choices)}{instead})"
        choice = click.STRING if prompt.typed else click.Choice(prompt.choices)

        def ask() -> str:
            default = prompt.default
            given: str = click.prompt(
                text, type=choice, default=default, show_choices=False, err=True
            )
            return given

        answer = await in_daemon_thread(ask)
        self._progress.start()
        self._answer(prompt.prompt, answer)


async def in_daemon_thread(ask: Callable[[], str]) -> str:
    """Wait for a person in a thread that does not keep the program alive when it is stopped."""
    loop = asyncio.get_running_loop()
    given: asyncio.Future[str] = loop.create_future()

    def settle(answer: str) -> None:
        if not given.done():
            given.set_result(answer)

    def wait() -> None:
        try:
            answer = ask()
        except click.Abort:
            signal.raise_signal(signal.SIGINT)
            return
        with suppress(RuntimeError):  # the loop has ended meanwhile: nobody wants the answer
            loop.call_soon_threadsafe(settle, answer)

    threading.Thread(target=wait, daemon=True, name="prompt").start()
    return await given


def _words(event: ev.Event, total: int) -> str:
    """One line for what an operator wants to read; empty for the rest."""
    match event:
        case ev.Connected(role=role, identity=who, address=address):
            return f"{role}: {who.product or who.kind} serial {who.serial or '?'} at {address}"
        case ev.AlarmRaised(alarm=alarm):
            return " ".join(f"! {alarm.device}: {alarm.what}. {alarm.remedy}".split())
        case ev.Suspended(why=why, remedy=remedy):
            return f"waiting: {why}. {remedy}"
        case ev.Released(why=why):
            return f"going on: {why}"
        case ev.ReadingRejected(pose_label=pose, nest=nest, why=why):
            return f"reading of nest {nest} at pose {pose or 'home'} set aside: {why}"
        case ev.StepDone(summary=summary, index=index):
            return f"  {index + 1} of {total}: {summary}"
        case ev.GateChecked(passed=passed, says=says):
            return f"  {'passed ' if passed else 'REFUSED'} {says}"
        case ev.WriteBackStage(stage=stage, says=says):
            return f"  {stage}: {says}"
        case ev.StepSkipped(index=index, why=why):
            return f"  {index + 1} of {total}: skipped, {why}"
    return ""


async def run_on_console(session: Session, *, quiet: bool) -> Outcome:
    """Connect, run to the end, and let go; an interrupt (Ctrl-C, SIGTERM) stops the machine.

    Raises what :meth:`Session.run` raises.
    """
    face = ConsoleFace(session.answer_prompt, len(session.plan.steps), quiet=quiet)
    leave = session.observers.watch(face.hear)
    try:
        with face.shown(), stopping(session.stop):
            await session.connect()
            return await session.run()
    finally:
        leave()
        await session.close()


@contextmanager
def stopping(stop: Callable[[], Any]) -> Iterator[None]:
    """Let SIGINT, SIGTERM and a closed terminal (SIGHUP) call ``stop`` in the running loop."""
    loop = asyncio.get_running_loop()
    under_way: set[asyncio.Future[Any]] = set()

    def begin() -> None:
        if not under_way:
            under_way.add(asyncio.ensure_future(stop()))

    def handle(signum: int, frame: FrameType | None) -> None:
        if signal.Signals(signum).name == "SIGHUP":
            write_to_nobody(terminals)
        loop.call_soon_threadsafe(begin)

    terminals = [descriptor for descriptor in (0, 1, 2) if os.isatty(descriptor)]
    numbers = [getattr(signal, name) for name in STOPS if hasattr(signal, name)]
    # Who began it with nohup wants it to go on without a terminal.
    numbers = [n for n in numbers if signal.getsignal(n) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def unattended(asked: bool) -> bool:
    """Whether nobody can answer: asked for, or there is no terminal."""
    return asked or not interactive()
