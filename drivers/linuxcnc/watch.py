"""Looks at LinuxCNC five times a second: gone, in emergency stop, switched off by somebody."""

import asyncio
from collections.abc import Callable
from contextlib import suppress

from drivers.errors import DeviceError, DeviceFault, LinkError
from drivers.linuxcnc.link import Answer, Ask

LOOK_S = 0.2


class Watch:
    """Faults stand until :meth:`clear`; ``tell`` hears of each once."""

    def __init__(
        self,
        ask: Ask,
        tell: Callable[[DeviceError], None],
        device: str,
    ) -> None:
        self._ask, self._tell, self._device = ask, tell, device
        self._on = False
        self._fault: DeviceError | None = None
        self._task: asyncio.Task[None] | None = None

    def begin(self, *, on: bool) -> None:
        """Watch from now on."""
        self._on = on
        self._task = asyncio.create_task(self._run(), name=f"watch {self._device}")

    async def end(self) -> None:
        """Watch no more."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    def expect(self, *, on: bool) -> None:
        """Whether the machine is meant to be on."""
        self._on = on

    def check(self) -> None:
        """Raise the fault that stands, a new one each time."""
        if self._fault is not None:
            fault = self._fault
            raise type(fault)(fault.what, device=fault.device, remedy=fault.remedy)

    def clear(self) -> None:
        """Forget it."""
        self._fault = None

    def look(self, state: Answer) -> None:
        """Judge one state."""
        if self._on and not state["on"]:
            self._stand(self.in_estop() if state["estop"] else self._off())

    def in_estop(self) -> DeviceFault:
        """What is said of an emergency stop."""
        return DeviceFault(
            "is in emergency stop",
            device=self._device,
            remedy="Release the emergency stop, then clear the fault",
        )

    def _off(self) -> DeviceFault:
        return DeviceFault(
            "was switched off, by itself or at its own screen",
            device=self._device,
            remedy="See LinuxCNC's messages (following error, limit), then clear the fault",
        )

    def _stand(self, fault: DeviceError) -> None:
        if self._fault is None:
            self._fault = fault
            self._tell(fault)

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                self.look(await self._ask("state"))
            except DeviceError as error:
                self._stand(error)
                if isinstance(error, LinkError):
                    return
