"""The wire itself: lines out, answers in, each before its deadline. Blocking.

A GCS command has no answer, a refused query has none either; ``ERR?`` says what became of it. So
every exchange ends with ``ERR?``, in one write: one round trip, and never a wait for an answer
that cannot come. Lines of an answer end with " \\n", the last one with "\\n".
"""

import re
import threading
import time
from collections.abc import Callable
from typing import Protocol, TypeVar

import serial

from drivers.errors import DeviceFault, LinkLost, ProtocolError, Silence
from drivers.gcs.errors import refusal

T = TypeVar("T")
ENCODING = "cp1252"
ANSWER_S = 1.0
READ_S, WRITE_S = 0.02, 0.5
LONGEST_ANSWER = 1 << 16
STOP, MOTION, READY = b"\x18", b"\x05", b"\x07"
IS_READY, IS_BUSY = "\xb1", "\xb0"
# What ends a line that was cut off while it was written, without completing it to a command.
NUMBER = re.compile(r"-?[0-9]{1,9}")
"""Longer ones are no error codes; Python takes no decimal of more than 4,300 digits."""
SPOIL = "?\n"
REMEDY = "Check cable, address and baud rate, then connect again."


class Port(Protocol):
    """What a line needs of a port of pyserial."""

    @property
    def in_waiting(self) -> int:
        """Number of bytes that have come."""

    def read(self, size: int = 1, /) -> bytes:
        """Return up to ``size`` bytes, fewer when the port's time-out ends."""

    def write(self, data: bytes, /) -> int | None:
        """Send."""

    def reset_input_buffer(self) -> None:
        """Forget what has come."""

    def close(self) -> None:
        """Release it."""


class Line:
    """One open port.

    Only :meth:`stop` may be called from another thread than the one that asks. After an answer
    that did not come, or made no sense, the next exchange first brings both sides into step.
    """

    def __init__(self, port: Port, device: str) -> None:
        self.device = device
        self.identity = ""
        self.stops = 0
        self._port = port
        self._writing = threading.Lock()
        self._rest = b""
        self._in_step = False

    # ------------------------------------------------------------ exchanges

    def command(self, text: str, timeout: float = ANSWER_S, stops: int | None = None) -> None:
        """Send a command and learn what became of it.

        ``stops``: refuse to send if :meth:`stop` was called since :attr:`stops` had this value.
        Raises Refused, DeviceFault (stopped), DriveFault, Silence, ProtocolError, LinkLost.
        """
        self._begin(timeout)
        # The first ERR? clears what was left by something else.
        self._write(f"ERR?\n{text}\nERR?\n", stops)
        self._error_code(timeout)
        code = self._error_code(timeout)
        self._in_step = True
        if code:
            raise refusal(code, text.split(maxsplit=1)[0], self.device)

    def query(self, text: str, timeout: float = ANSWER_S) -> list[str]:
        """Send a query and return the lines of its answer; raises as :meth:`command`.

        A query whose answer is lost or garbled is repeated once.
        """
        return self._twice(lambda: self._query(text, timeout), timeout)

    def bare(self, text: str, timeout: float = ANSWER_S) -> str:
        """Send a query whose answer is a bare number, as that of ``ERR?``; raises as above.

        What ends the exchange is the identity: before it come two answers, or a refusal alone.
        """
        return self._twice(lambda: self._bare(text, timeout), timeout)

    def moving(self) -> bool:
        """Whether any axis moves (#5); raises as :meth:`query`."""
        return self._twice(self._moving, ANSWER_S)

    def ready(self) -> bool:
        """Whether it takes commands (#7), not busy with a reference move; raises as above."""
        return self._twice(self._ready, ANSWER_S)

    def _twice(self, ask: Callable[[], T], timeout: float) -> T:
        try:
            return ask()
        except (Silence, ProtocolError) as error:
            try:
                self.synchronise(timeout)
            except Silence:
                raise error from None
        return ask()

    def _query(self, text: str, timeout: float) -> list[str]:
        self._begin(timeout)
        self._write(f"{text}\nERR?\n")
        answer = self._answer(timeout)
        if len(answer) == 1 and NUMBER.fullmatch(answer[0]):
            self._in_step = True
            raise refusal(int(answer[0]), text.split(maxsplit=1)[0], self.device)
        self._error_code(timeout)
        self._in_step = True
        return answer

    def _bare(self, text: str, timeout: float) -> str:
        self._begin(timeout)
        self._write(f"{text}\nERR?\n*IDN?\n")
        answers = []
        while (answer := self._answer(timeout)) != [self.identity]:
            answers.append(" ".join(answer))
        if not 1 <= len(answers) <= 2 or not NUMBER.fullmatch(answers[-1]):
            raise self._nonsense(" ".join(answers))
        self._in_step = True
        if len(answers) == 1:
            raise refusal(int(answers[0]), text.split(maxsplit=1)[0], self.device)
        return answers[0]

    def _moving(self) -> bool:
        self._begin(ANSWER_S)
        self._write(MOTION.decode(ENCODING))
        answer = self._answer(ANSWER_S)
        try:
            mask = int(answer[0], 16)
        except ValueError as error:
            raise self._nonsense(answer[0]) from error
        self._in_step = True
        return mask != 0

    def _ready(self) -> bool:
        self._begin(ANSWER_S)
        self._write(READY.decode(ENCODING))
        answer = self._answer(ANSWER_S)[0]
        if answer not in (IS_READY, IS_BUSY):
            raise self._nonsense(answer)
        self._in_step = True
        return answer == IS_READY

    def stop(self) -> None:
        """Send #24, past everything that waits; from any thread. Raises LinkLost, Silence."""
        with self._writing:
            self.stops += 1
            self._write_bytes(STOP)

    def _begin(self, timeout: float) -> None:
        """Come into step if need be, and be out of it until this exchange has ended well."""
        if not self._in_step:
            self.synchronise(timeout)
        self._in_step = False

    def synchronise(self, timeout: float = ANSWER_S) -> None:
        """Ask who is there and skip every late answer before that; raises Silence."""
        try:
            self._port.reset_input_buffer()
        except OSError as error:
            raise self._lost(error) from error
        self._rest = b""
        self._write(f"{SPOIL}*IDN?\n")
        deadline = time.monotonic() + timeout
        while True:
            answer = self._answer(deadline - time.monotonic())[0]
            if answer == self.identity or (not self.identity and answer.count(",") >= 3):
                break
        self.identity = answer
        self._in_step = True

    def _error_code(self, timeout: float) -> int:
        answer = self._answer(timeout)
        if len(answer) != 1 or not NUMBER.fullmatch(answer[0]):
            raise self._nonsense(" ".join(answer))
        return int(answer[0])

    # ------------------------------------------------------------ bytes

    def _write(self, text: str, stops: int | None = None) -> None:
        with self._writing:
            if stops is not None and stops != self.stops:
                raise DeviceFault(
                    "the machine was stopped: the command was not sent",
                    device=self.device,
                    remedy="Enable the machine and start again.",
                )
            self._write_bytes(text.encode(ENCODING))

    def _write_bytes(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise Silence("takes no bytes", device=self.device, remedy=REMEDY) from error
        except OSError as error:
            raise self._lost(error) from error

    def _answer(self, timeout: float) -> list[str]:
        """Return the lines of one answer."""
        deadline = time.monotonic() + timeout
        while (end := _end_of_answer(self._rest)) < 0:
            data = self._read()
            if not data and time.monotonic() > deadline:
                raise self._silence(timeout)
            self._rest += data
            if len(self._rest) > LONGEST_ANSWER:
                raise self._nonsense("an answer without end")
        text, self._rest = self._rest[:end].decode(ENCODING, "replace"), self._rest[end + 1 :]
        return [line.strip() for line in text.split("\n")]

    def _read(self) -> bytes:
        try:
            return bytes(self._port.read(self._port.in_waiting or 1))
        except OSError as error:
            raise self._lost(error) from error

    def _silence(self, timeout: float) -> Silence:
        torn = f"; its answer broke off after {self._rest!r}" if self._rest else ""
        return Silence(
            f"no answer within {max(timeout, 0.0):.1f} s{torn}", device=self.device, remedy=REMEDY
        )

    def _nonsense(self, text: str) -> ProtocolError:
        return ProtocolError(
            f"answers {text[:60]!r}, which makes no sense here", device=self.device, remedy=REMEDY
        )

    def _lost(self, error: OSError) -> LinkLost:
        return LinkLost(
            f"the link is gone ({error})",
            device=self.device,
            remedy="Check cable and power; then connect again.",
        )

    def close(self) -> None:
        """Release the port."""
        connection = getattr(self._port, "_socket", None)
        try:
            self._port.close()
        finally:
            # pyserial does not get as far as this where the other side is gone.
            if connection is not None:
                connection.close()


def _end_of_answer(data: bytes) -> int:
    """Index of the line feed that ends an answer: one without a space before it; -1 if none."""
    end = data.find(b"\n")
    while end > 0 and data[end - 1 : end] == b" ":
        end = data.find(b"\n", end + 1)
    return end
