"""One running measurement: what it has delivered, or why it has ended."""

import asyncio

from drivers.emscon import wire
from drivers.emscon.codes import Event, PacketType, Status, status_words
from drivers.errors import BeamBroken, DeviceError, MeasurementError, NoTarget, NotReady, Refused

_NOT_READY = {
    Status.SERVER_BUSY,
    Status.NOT_INITIALIZED,
    Status.INTERNAL_PROCESS_ACTIVE,
    Status.NOT_WARMED_UP,
    Status.NOT_STABLE,
}
_NOT_LOCKED = {Status.NO_DISTANCE_SET, Status.MEAS_STATUS_NOT_READY}
_RESULTS = {PacketType.SINGLE_RESULT, PacketType.SINGLE_RESULT_2, PacketType.MULTI_RESULT}
_REMEDY = "Clear the line of sight, lock on the reflector and measure again."


def fault_of(status: int, device: str) -> DeviceError:
    """The typed error for a status in the course of a measurement."""
    words = status_words(status)
    if status == Status.NOT_INITIALIZED:
        return NotReady(words, device=device, remedy="Initialise the tracker.")
    if status in _NOT_READY:
        return NotReady(words, device=device, remedy="Wait until it is warm and stable.")
    if status == Status.NO_STATIONARY_RESULT:
        remedy = "Let the machine settle, then measure again."
        return MeasurementError(words, device=device, remedy=remedy)
    return BeamBroken(words, device=device, remedy=_REMEDY)


def refusal(error: Refused, device: str) -> DeviceError:
    """The typed error for a refused command; itself where there is no better type."""
    status = error.code if error.code is not None else -1
    if status in _NOT_READY or status in _NOT_LOCKED:
        return fault_of(status, device)
    if status in (Status.NO_TARGET_FOUND, Status.NO_LAST_POINT):
        remedy = "Put the reflector where the beam points, or point the beam at it."
        return NoTarget(error.what, device=device, remedy=remedy)
    return error


class Measurement:
    """Collects the data packets that belong to one StartMeasurement.

    Data that arrive before the start is answered belong to an earlier measurement and are
    dropped. Any NotReady event, any error not tied to a command, means that the beam was lost.
    """

    def __init__(self, device: str) -> None:
        self._device = device
        self._started = False
        self._packets: asyncio.Queue[wire.Packet | DeviceError] = asyncio.Queue()
        self._ended: DeviceError | None = None

    def hear(self, packet: wire.Packet) -> None:
        """Look at a packet; the reader's task calls this for each, in the order of arrival."""
        start = wire.COMMANDS["StartMeasurement"].code
        if packet.type == PacketType.COMMAND and packet.command == start and packet.status == 0:
            self._started = True
        elif packet.type in _RESULTS and self._started:
            if packet.status != Status.OK:
                self.fail(fault_of(packet.status, self._device))
            else:
                self._packets.put_nowait(packet)
        elif packet.type == PacketType.STATUS_CHANGE and packet.event == Event.NOT_READY:
            self.fail(BeamBroken("the beam was broken", device=self._device, remedy=_REMEDY))
        elif packet.type == PacketType.ERROR and self._concerns_us(packet.command):
            self.fail(fault_of(packet.status, self._device))

    def _concerns_us(self, command: int) -> bool:
        """Errors that name another command answer that command; the others are about the beam."""
        start = wire.COMMANDS["StartMeasurement"].code
        return command not in wire.BY_CODE or (command == start and self._started)

    def fail(self, error: DeviceError) -> None:
        """End the measurement without (further) data; the first reason counts."""
        if self._ended is None:
            self._ended = error
            self._packets.put_nowait(error)

    async def next(self) -> wire.Packet:
        """The next data packet; raises what ended the measurement."""
        if self._packets.empty() and self._ended is not None:
            raise self._ended
        got = await self._packets.get()
        if isinstance(got, DeviceError):
            raise got
        return got
