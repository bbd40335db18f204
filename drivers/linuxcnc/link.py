"""The helper process that has LinuxCNC's own modules: requests and answers, deadlines on all."""

import asyncio
import json
import os
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Protocol

from drivers.errors import ConnectFailed, LinkLost, ProtocolError, Refused, Silence

HELPER = Path(__file__).with_name("helper.py")
START_S, END_S = 10.0, 2.0
LONGEST_LINE = 1 << 20
AGAIN = "See whether LinuxCNC hangs, then connect again."
ITS_SCREEN = "See what LinuxCNC says on its own screen."
Answer = Mapping[str, Any]


class Ask(Protocol):
    """:meth:`LinuxCncLink.ask` of the link that there is now."""

    async def __call__(self, do: str, within_s: float | None = None, **arguments: Any) -> Answer:
        """One request and its answer."""


class LinuxCncLink:
    """One helper; it ends with its standard input, and so with us."""

    def __init__(self, process: Process, device: str, answer_s: float, said: list[str]) -> None:
        self.device = device
        self._said = said
        self._process = process
        self._answer_s = answer_s
        self._turn = asyncio.Lock()
        self._number = 0

    @classmethod
    async def open(
        cls, python: str, env: Mapping[str, str], device: str, answer_s: float, said: list[str]
    ) -> "LinuxCncLink":
        """Start the helper; raises ConnectFailed if it does not find a LinuxCNC that runs.

        ``said`` collects the errors that LinuxCNC reports.
        """
        try:
            process = await asyncio.create_subprocess_exec(
                python, str(HELPER), stdin=PIPE, stdout=PIPE, stderr=DEVNULL,
                env={**os.environ, **env}, limit=LONGEST_LINE,
            )  # fmt: skip
        except OSError as error:
            raise ConnectFailed(
                f"{python} cannot be started ({error.strerror})",
                device=device,
                remedy="Write python under [controller]: the Python that has LinuxCNC's modules",
            ) from error
        link = cls(process, device, answer_s, said)
        try:
            first = await link._line(START_S)
        except (LinkLost, Silence) as error:
            await link.close()
            raise ConnectFailed(
                f"{python} finds no LinuxCNC ({error.what})",
                device=device,
                remedy="Check that LinuxCNC runs on this computer, that this Python has its "
                "modules linuxcnc and hal, and env in the site file",
            ) from error
        if not first.get("ok"):
            await link.close()
            raise ConnectFailed(
                str(first.get("error") or "LinuxCNC does not run"),
                device=device,
                remedy="Start LinuxCNC; as root, env of the site file must be that of LinuxCNC",
            )
        return link

    async def ask(self, do: str, within_s: float | None = None, **arguments: Any) -> Answer:
        """One request and its answer.

        Raises
        ------
        LinkLost
            If LinuxCNC, or the helper, is gone.
        Silence
            If no answer came within ``within_s``; the helper is then ended.
        Refused
            If LinuxCNC said no.
        """
        # Whoever asks may be cancelled; an answer that nobody took would be taken for another's.
        exchange = asyncio.ensure_future(self._exchange(do, within_s, arguments))
        exchange.add_done_callback(lambda done: done.cancelled() or done.exception())
        return await asyncio.shield(exchange)

    async def _exchange(
        self, do: str, within_s: float | None, arguments: Mapping[str, Any]
    ) -> Answer:
        async with self._turn:
            self._number += 1
            request = json.dumps({"id": self._number, "do": do, **arguments}) + "\n"
            assert self._process.stdin is not None
            try:
                self._process.stdin.write(request.encode())
                await self._process.stdin.drain()
            except (OSError, RuntimeError) as error:
                raise self._lost() from error
            found = await self._line(within_s or self._answer_s)
        if found.get("id") != self._number:
            raise ProtocolError(f"the helper answered {found}", device=self.device, remedy=AGAIN)
        self._said += found.get("said", [])
        if not found.get("alive"):
            raise self._lost()
        if not found.get("ok"):
            raise Refused(str(found.get("error")), device=self.device, remedy=ITS_SCREEN)
        return found

    async def _line(self, within_s: float) -> dict[str, Any]:
        assert self._process.stdout is not None
        try:
            async with asyncio.timeout(within_s):
                line = await self._process.stdout.readline()
        except TimeoutError:
            self._kill()
            raise Silence(
                f"no answer within {within_s:g} s", device=self.device, remedy=AGAIN
            ) from None
        if not line:
            raise self._lost()
        try:
            found: dict[str, Any] = json.loads(line)
        except ValueError as error:
            raise ProtocolError(
                f"the helper wrote {line[:80]!r}", device=self.device, remedy=AGAIN
            ) from error
        return found

    def _lost(self) -> LinkLost:
        return LinkLost(
            "LinuxCNC does not run any more",
            device=self.device,
            remedy="Start LinuxCNC again; the machine must be homed, then go on",
        )

    def _kill(self) -> None:
        with suppress(ProcessLookupError):
            self._process.kill()

    async def close(self) -> None:
        """End the helper; never raises."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            async with asyncio.timeout(END_S):
                await self._process.wait()
        except TimeoutError:
            self._kill()
            await self._process.wait()
