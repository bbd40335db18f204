"""A mock station as a process of this program's own: it starts, its words are kept, it ends."""

import asyncio
import json
from collections.abc import Callable, Sequence

from app.again import command_of
from app.files.site import Site, site_of_mock
from drivers.errors import ConnectFailed, Silence

START_S, END_S = 30.0, 5.0
DEVICE = "mock station"


class MockProcess:
    """One mock; ``site`` is the site file that it stands for."""

    def __init__(self, process: asyncio.subprocess.Process, site: Site) -> None:
        self._process = process
        self._reading: asyncio.Task[None] | None = None
        self.site = site

    @classmethod
    async def start(cls, arguments: Sequence[str], hear: Callable[[str], None]) -> "MockProcess":
        """Start one with the arguments of ``pkmcal mock``; ``hear`` gets each line that it says.

        Raises
        ------
        DeviceError
            If it says nothing, or ends at once.
        """
        # However this program ends, its mock's standard input ends with it, and so does the mock.
        ends_with_us = ("--json", "--until-stdin-closes")
        process = await asyncio.create_subprocess_exec(
            *command_of("mock", *arguments, *ends_with_us),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        assert process.stdout is not None
        try:
            async with asyncio.timeout(START_S):
                line = await process.stdout.readline()
        except TimeoutError as error:
            await _end(process)
            raise Silence(
                f"said nothing within {START_S:.0f} s",
                device=DEVICE,
                remedy="Start it again; a busy computer is slow",
            ) from error
        if not line:
            said = await _last_words(process)
            await _end(process)
            raise ConnectFailed(
                f"it ended at once: {said}",
                device=DEVICE,
                remedy="m again: the line is as you typed it. pkmcal mock --help lists all options",
            )
        mock = cls(process, site_of_mock(json.loads(line)))
        # Pipes that nobody reads fill up and block the station.
        mock._reading = asyncio.create_task(_drain(process, hear))
        return mock

    @property
    def ended(self) -> bool:
        """Whether it has ended by itself."""
        return self._process.returncode is not None

    def kill(self) -> None:
        """End it as a power failure would."""
        self._process.kill()

    async def end(self) -> None:
        """End it, and wait for that."""
        await _end(self._process)
        if self._reading is not None:
            self._reading.cancel()


async def _end(process: asyncio.subprocess.Process) -> None:
    if process.returncode is not None:
        return
    # Its standard input ends it in its own order, also where terminate() would kill it (Windows).
    assert process.stdin is not None
    process.stdin.close()
    try:
        async with asyncio.timeout(END_S):
            await process.wait()
    except TimeoutError:
        process.kill()
        await process.wait()


async def _last_words(process: asyncio.subprocess.Process) -> str:
    assert process.stderr is not None
    try:
        async with asyncio.timeout(END_S):
            lines = (await process.stderr.read()).decode(errors="replace").strip().splitlines()
    except TimeoutError:
        return "no reason given"
    return lines[-1].removeprefix("pkmcal mock: ") if lines else "no reason given"


async def _drain(process: asyncio.subprocess.Process, hear: Callable[[str], None]) -> None:
    async def read(stream: asyncio.StreamReader | None) -> None:
        while stream is not None and (line := await stream.readline()):
            hear(line.decode(errors="replace").rstrip())

    await asyncio.gather(read(process.stdout), read(process.stderr))
