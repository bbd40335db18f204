"""Looking after the controller: it says nothing unasked, so it is asked several times a second."""

from collections.abc import Sequence

from drivers.errors import DeviceFault, DriveFault
from drivers.gcs.answers import registers
from drivers.gcs.axes import ERROR, Axes
from drivers.gcs.layout import WATCHDOG
from drivers.gcs.line import ANSWER_S, Line
from drivers.gcs.link import GcsLink
from drivers.gcs.parameter_access import ParameterAccess


class Watch:
    """Finds servos in fault, and a controller that was switched off meanwhile.

    ``watchdog_ms``: how long the controller goes on without hearing from this PC; 0 if it has no
    such watchdog. It is volatile, so it also tells that the controller has started anew.
    """

    def __init__(
        self, link: GcsLink, axes: Axes, parameters: ParameterAccess, watchdog_ms: int
    ) -> None:
        self._link = link
        self._axes = axes
        self._parameters = parameters
        self._watchdog_ms = watchdog_ms

    def begin(self, line: Line) -> None:
        """Let the controller watch this PC."""
        if self._watchdog_ms:
            line.command(f"SPA 1 0x{WATCHDOG:X} {self._watchdog_ms}")
        self.read(line)

    def end(self, line: Line) -> None:
        """Let the controller forget this PC."""
        if self._watchdog_ms:
            line.command(f"SPA 1 0x{WATCHDOG:X} 0")

    def look(self, line: Line, timeout: float) -> None:
        """Latch what is wrong; called in the worker thread between two jobs."""
        self.read(line, timeout)
        if self._watchdog_ms and self._parameters.whole(line, WATCHDOG, timeout) == 0:
            self._link.latch(
                "restart",
                DeviceFault(
                    "was switched off and on: what was not stored is lost",
                    device=self._link.device,
                    remedy="Clear the faults, compare the parameters and enable the machine again.",
                ),
            )

    def read(self, line: Line, timeout: float = ANSWER_S) -> tuple[int, ...]:
        """Return status register 1 of every actuator; servos in fault are latched."""
        words = " ".join(f"{axis} 1" for axis in self._axes.driven)
        bits = registers(line.query(f"SRG? {words}", timeout), self._axes.driven, line.device)
        self._note_faults(bits)
        return bits

    async def registers(self) -> tuple[int, ...]:
        """Return them from the event loop."""
        return await self._link.call(self.read)

    def _note_faults(self, bits: Sequence[int]) -> None:
        for (name, axis), word in zip(self._axes.actuators.items(), bits, strict=True):
            if word & ERROR:
                fault = DriveFault(
                    "the servo switched itself off (following error or hardware)",
                    device=f"drive {name} (axis {axis})",
                    remedy="Remove the cause, clear the faults and enable the machine again.",
                )
                self._link.latch(f"drive {name}", fault)
