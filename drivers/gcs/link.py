"""A line in a thread of its own: calls from the event loop, the watch, and the faults that stand.

One worker thread reads and writes; between two jobs it looks after the controller. A stop goes
out from a second thread, past every job that waits.
"""

import asyncio
import contextlib
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

import serial

from drivers.errors import (
    ConnectFailed,
    DeviceError,
    HeartbeatLost,
    LinkLost,
    ProtocolError,
    Silence,
)
from drivers.gcs.line import READ_S, WRITE_S, Line, Port

T = TypeVar("T")
OPEN_S = 6.0
WATCH_S = 0.2
Job = tuple[Callable[[Line], Any], "Future[Any]"]


class GcsLink:
    """An open line with its worker. Use :meth:`open`.

    ``look`` runs in the worker between jobs; faults that it finds are latched. ``on_fault`` is
    called in the event loop for each new standing fault.
    """

    def __init__(self, line: Line, silence_s: float) -> None:
        self.line = line
        self.device = line.device
        self.faults: dict[str, DeviceError] = {}
        self.on_fault: Callable[[DeviceError], None] = lambda _: None
        self.look: Callable[[Line, float], None] | None = None
        self.closed = False
        self.silence_s = silence_s
        self._loop = asyncio.get_running_loop()
        self._jobs: queue.Queue[Job | None] = queue.Queue()
        self._urgent = ThreadPoolExecutor(1, thread_name_prefix="gcs-stop")
        self._worker = threading.Thread(target=self._work, name="gcs", daemon=True)
        self._worker.start()

    @classmethod
    async def open(cls, port: str, baudrate: int, silence_s: float) -> "GcsLink":
        """Open a serial port or ``socket://host:port``; raises ConnectFailed."""
        device = f"controller at {port}"
        remedy = "Check the port in the site file, cable and power of the controller."
        loop = asyncio.get_running_loop()
        opener = ThreadPoolExecutor(1, thread_name_prefix="gcs-open")
        opening = loop.run_in_executor(opener, _open_port, port, baudrate)
        try:
            opened = await asyncio.wait_for(asyncio.shield(opening), OPEN_S)
        except TimeoutError as error:
            opening.add_done_callback(_close_late)
            what = f"the port did not open within {OPEN_S} s"
            raise ConnectFailed(what, device=device, remedy=remedy) from error
        except (OSError, ValueError) as error:
            raise ConnectFailed(str(error), device=device, remedy=remedy) from error
        finally:
            opener.shutdown(wait=False)
        return cls(Line(opened, device), silence_s)

    # ------------------------------------------------------------ calls

    async def call(self, action: Callable[[Line], T]) -> T:
        """Run a blocking ``action`` on the line in the worker thread."""
        if self.closed:
            raise LinkLost("the link is closed", device=self.device, remedy="Connect again.")
        future: Future[T] = Future()
        self._jobs.put((action, future))
        return await asyncio.wrap_future(future)

    async def stop(self) -> None:
        """Send #24 past everything that waits; raises LinkLost, Silence."""
        if self.closed:
            raise LinkLost("the link is closed", device=self.device, remedy="Connect again.")
        await self._loop.run_in_executor(self._urgent, self.line.stop)

    # ------------------------------------------------------------ the worker

    def _work(self) -> None:
        next_look = time.monotonic() + WATCH_S
        while True:
            try:
                job = self._jobs.get(timeout=max(next_look - time.monotonic(), 0.0))
            except queue.Empty:
                pass
            else:
                if job is None:
                    return
                self._carry_out(*job)
            if time.monotonic() >= next_look:
                self._look()
                next_look = time.monotonic() + WATCH_S

    def _carry_out(self, action: Callable[[Line], Any], future: "Future[Any]") -> None:
        if not future.set_running_or_notify_cancel():
            return
        try:
            if "link" in self.faults:
                raise self.faults["link"]
            future.set_result(action(self.line))
        except BaseException as error:
            if isinstance(error, LinkLost):
                self.latch("link", error)
            future.set_exception(error)

    def _look(self) -> None:
        """Ask how the controller is; an answer may get lost, that to the repetition not."""
        if self.look is None or self.faults.keys() & {"link", "silent"}:
            return
        try:
            self.look(self.line, 0.5 * self.silence_s)
        except LinkLost as error:
            self.latch("link", error)
        except (Silence, ProtocolError) as error:
            self._lose(error)
        except DeviceError as error:
            self.latch("refused", error)

    def _lose(self, error: DeviceError) -> None:
        self.latch(
            "silent",
            HeartbeatLost(
                f"cannot be asked how it is ({error.what})",
                device=self.device,
                remedy="It has been told to stop, and stops by itself. Check power and cable.",
            ),
        )
        try:
            self.line.stop()
        except DeviceError as lost:
            self.latch("link", lost)

    # ------------------------------------------------------------ faults

    def latch(self, key: str, fault: DeviceError) -> None:
        """Let ``fault`` stand and tell of it once; from any thread."""
        if key not in self.faults and not self.closed:
            self.faults = {**self.faults, key: fault}
            # A fault may still come while the loop closes.
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self.on_fault, fault)

    def clear_faults(self) -> None:
        """Forget the standing faults, except that the link is gone."""
        self.faults = {key: fault for key, fault in self.faults.items() if key == "link"}

    def check(self) -> None:
        """Raise the fault that is standing, the link's own first."""
        fault = self.faults.get("link") or next(iter(self.faults.values()), None)
        if fault is not None:
            raise fault

    def stop_at_once(self) -> None:
        """Send the stop from any thread, past everything that waits; never raises."""
        with contextlib.suppress(DeviceError):
            self.line.stop()

    async def close(self) -> None:
        """Release the port; never raises."""
        if self.closed:
            return
        self.closed = True
        self._jobs.put(None)
        await self._loop.run_in_executor(self._urgent, self._end)
        self._urgent.shutdown(wait=False)

    def _end(self) -> None:
        self._worker.join(3.0)
        while not self._jobs.empty():
            job = self._jobs.get_nowait()
            if job is not None:
                job[1].cancel()
        with contextlib.suppress(OSError):
            self.line.close()


def _open_port(port: str, baudrate: int) -> Port:
    options: dict[str, Any] = {"baudrate": baudrate, "timeout": READ_S, "write_timeout": WRITE_S}
    if "://" not in port:
        options["exclusive"] = True
    opened: Port = serial.serial_for_url(port, **options)
    return opened


def _close_late(opening: "asyncio.Future[Port]") -> None:
    """Nobody waits any more for this port."""
    if not opening.cancelled() and opening.exception() is None:
        opening.result().close()
