"""The back door of a station: what people do with their hands, and what judges may know.

One JSON object a line each way. A request names what to ``do``; the answer has ``ok`` and, if
that is false, ``error`` in words.

==================  ==================================================================
``do``              with
==================  ==================================================================
carry               nest (or "birdbath", "hand"), smr = 1, follow = true (keep the beam on it)
place               nests = [..]: SMR 1, 2, .. into these nests
where               answers where every SMR is
span                nest, nest2: the bar between a nest of the platform and one of the base
take-off            the bar is taken off
swap-smr            smr, off_mm: take one of another diameter
exchange            first, second: two SMRs change places
break-beam          for_s (machine s; without: until restore-beam), status
restore-beam
break-next-dwell    at = fraction of the dwell, for_s
stall / unstall     leg = 1, 2, .. (an actuator)
fault / clear       name (list in mocks/faults.py); clear without a name ends all
faults              answers what is wrong now
payload             kg
temperature         structure_C
jump-tracker        x, y, z (mm), rx, ry, rz (rad)
tracker-error       status: an Error packet that nobody asked for
reset-tcp           of = "tracker" | "controller"
time                answers machine time and scale
truth               settled = false: answers true pose, parameters, frame (for judges)
sets                answers the CRC-32 of the parameters that a CANopen controller holds, and
                    those with which it began its motions, with how many (for judges)
==================  ==================================================================
"""

import asyncio
import json
import re
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Protocol

import numpy as np

from mocks.canopen.server import CanopenStation
from mocks.gauge import GaugeMock
from mocks.physics.pose import rpy_from_rotation
from mocks.tracker.instrument import BEAM_BROKEN_STATUS
from mocks.tracker.server import TrackerServer
from mocks.world import World

LONGEST_LINE = 1 << 20
_HTTP = re.compile(rb"[A-Z]+ \S+ HTTP/|[A-Za-z-]+: ")
"""The first line of a browser's request, or a line of its head."""
SETTLED_AFTER_S = 20.0
Arguments = Mapping[str, Any]


class Cuttable(Protocol):
    """A server whose clients can be cut off."""

    def cut(self, reset: bool = False) -> None:
        """Cut every client off, ``reset`` with a TCP RST."""


class Hands:
    """Carries out the commands of the control socket; raises ValueError for what it cannot."""

    def __init__(
        self,
        world: World,
        tracker: TrackerServer,
        controller: Cuttable | None = None,
        gauge: GaugeMock | None = None,
    ) -> None:
        self._world, self._tracker, self._controller = world, tracker, controller
        self._instrument = tracker.instrument
        self._gauge = gauge
        self._commands: dict[str, Callable[[Arguments], Any]] = {
            "carry": self._carry,
            "place": self._place,
            "span": self._span,
            "take-off": self._take_off,
            "where": lambda a: {"places": world.smrs.places},
            "swap-smr": lambda a: world.smrs.swap_for_other(_smr(a["smr"]), float(a["off_mm"])),
            "exchange": lambda a: world.smrs.exchange(_smr(a["first"]), _smr(a["second"])),
            "break-beam": self._break_beam,
            "restore-beam": lambda a: {"locked": self._instrument.restore_beam()},
            "break-next-dwell": self._break_next,
            "stall": lambda a: self._stall(a, True),
            "unstall": lambda a: self._stall(a, False),
            "fault": lambda a: world.faults.inject(str(a["name"])),
            "clear": self._clear,
            "faults": lambda a: {"faults": sorted(world.faults)},
            "payload": self._payload,
            "temperature": self._temperature,
            "jump-tracker": self._jump,
            "tracker-error": lambda a: self._instrument.unsolicited(int(a["status"])),
            "reset-tcp": self._reset,
            "time": lambda a: {"time_s": world.clock.now(), "scale": world.clock.scale},
            "truth": self._truth,
            "sets": self._sets,
        }

    def obey(self, request: Arguments) -> dict[str, Any]:
        """Carry out one request; the answer is ready for JSON."""
        try:
            command = self._commands[request["do"]]
        except KeyError:
            known = ", ".join(sorted(self._commands))
            return {"ok": False, "error": f'what to "do" must be one of: {known}'}
        try:
            return {"ok": True, **(command(request) or {})}
        except KeyError as error:
            return {"ok": False, "error": f'"{request["do"]}" needs {error}'}
        except (ValueError, TypeError) as error:
            return {"ok": False, "error": str(error)}

    def _carry(self, a: Arguments) -> dict[str, Any]:
        smr, place = _smr(a.get("smr", 1)), str(a["nest"])
        for wrong in self._world.faults.arguments("misplace"):
            self._world.faults.take(f"misplace:{wrong}")
            place = wrong
        if not a.get("follow", True) and smr == self._instrument.beam.locked:
            self._instrument.drop_smr()
        self._world.smrs.put(smr, place)
        return {"smr": smr, "nest": str(a["nest"])}

    def _place(self, a: Arguments) -> None:
        nests = [str(nest) for nest in a["nests"]]
        for index in range(len(nests)):
            self._world.smrs.put(_smr(index + 1), "hand")
        for index, nest in enumerate(nests):
            self._world.smrs.put(_smr(index + 1), nest)

    def _span(self, a: Arguments) -> None:
        self._bar().span(str(a["nest"]), str(a["nest2"]))

    def _take_off(self, a: Arguments) -> None:
        self._bar().between = None

    def _bar(self) -> GaugeMock:
        if self._gauge is None:
            raise ValueError("this station has no gauge")
        return self._gauge

    def _break_beam(self, a: Arguments) -> None:
        self._instrument.break_beam(int(a.get("status", BEAM_BROKEN_STATUS)))
        if a.get("for_s") is not None:
            wall = float(a["for_s"]) / self._world.clock.scale
            asyncio.get_running_loop().call_later(wall, self._instrument.restore_beam)

    def _break_next(self, a: Arguments) -> None:
        fraction = float(a.get("at", 0.5))
        if not 0.0 <= fraction < 1.0:
            raise ValueError(f"at must be a fraction of the dwell, 0 <= at < 1, got {fraction}")
        for_s = a.get("for_s")
        self._instrument.measuring.break_next = (
            fraction,
            None if for_s is None else float(for_s),
        )

    def _stall(self, a: Arguments, jammed: bool) -> None:
        leg = int(a["leg"])
        if not 1 <= leg <= len(self._world.legs):
            raise ValueError(f"leg must be 1..{len(self._world.legs)}, got {leg}")
        self._world.legs[leg - 1].stalled = jammed

    def _clear(self, a: Arguments) -> None:
        if "name" in a:
            self._world.faults.clear(str(a["name"]))
        else:
            self._world.faults.clear_all()

    def _payload(self, a: Arguments) -> None:
        mass = float(a["kg"])
        if not 0.0 <= mass < 1000.0:
            raise ValueError(f"kg must be between 0 and 1000, got {mass}")
        self._world.payload_kg = mass

    def _temperature(self, a: Arguments) -> None:
        climate = self._world.climate
        climate.set_structure(self._world.clock.now(), float(a["structure_C"]))

    def _jump(self, a: Arguments) -> None:
        names = ("x", "y", "z", "rx", "ry", "rz")
        self._world.jump_tracker(np.array([float(a.get(name, 0.0)) for name in names]))

    def _reset(self, a: Arguments) -> None:
        of = a.get("of", "tracker")
        if of == "tracker":
            self._tracker.reset_connection()
        elif of == "controller" and self._controller is not None:
            self._controller.cut(reset=True)
        else:
            raise ValueError(f'of must be "tracker" or "controller", got {of!r}')

    def _sets(self, a: Arguments) -> dict[str, Any]:
        if not isinstance(self._controller, CanopenStation):
            raise ValueError("this station's controller is not on CANopen")
        return {"holds": self._controller.holds, "moved_with": self._controller.moved_with}

    def _truth(self, a: Arguments) -> dict[str, Any]:
        world = self._world
        now = world.clock.now()
        if a.get("settled", False):
            now += SETTLED_AFTER_S
        pose = world.pose(np.array([now]))
        return {
            "time_s": now,
            "position": pose.position[0].tolist(),
            "rotation": pose.rotation[0].tolist(),
            "rpy": rpy_from_rotation(pose.rotation)[0].tolist(),
            "extension": world.encoder_extension().tolist(),
            "moving": any(leg.moving for leg in world.legs),
            "parameters": world.parameters,
            "frame": world.station.frame(),
            "hidden": world.plan.hidden.values,
        }


def _smr(number: object) -> str:
    """Name of an SMR: 1 is ``smr1``; names stay."""
    return f"smr{number}" if isinstance(number, int) or str(number).isdigit() else str(number)


class ControlServer:
    """Serves :class:`Hands` on ``host:port`` (port 0: any free one)."""

    def __init__(self, hands: Hands, host: str = "127.0.0.1", port: int = 0) -> None:
        self._hands = hands
        self._host, self._port = host, port
        self._server: asyncio.Server | None = None
        self._writers: set[asyncio.StreamWriter] = set()

    @property
    def address(self) -> str:
        """``host:port``."""
        return f"{self._host}:{self._port}"

    async def start(self) -> None:
        """Listen."""
        self._server = await asyncio.start_server(
            self._serve, self._host, self._port, limit=LONGEST_LINE
        )
        self._port = self._server.sockets[0].getsockname()[1]

    async def stop(self) -> None:
        """Close everything."""
        if self._server is not None:
            self._server.close()
        for writer in tuple(self._writers):
            writer.transport.abort()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        try:
            while line := await reader.readline():
                if _HTTP.match(line):
                    return  # a browser: what a page sends is nobody's hands
                writer.write(json.dumps(self._answer(line)).encode() + b"\n")
                await writer.drain()
        except (OSError, ValueError):
            writer.transport.abort()  # gone, or a line without end
        finally:
            self._writers.discard(writer)
            writer.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            request = json.loads(line)
        except ValueError as error:
            return {"ok": False, "error": f"not JSON: {error}"}
        if not isinstance(request, dict):
            return {"ok": False, "error": "a request is a JSON object"}
        return self._hands.obey(request)


class ControlClient:
    """The hands of tests and demonstrations: ``client("carry", nest="4")``.

    Blocking; ``timeout`` in wall seconds for each request. Raises ValueError with the station's
    words if it says no, OSError if it is gone.
    """

    def __init__(self, address: str, timeout: float = 10.0) -> None:
        host, _, port = address.rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout)
        self._file = self._socket.makefile("rb")

    def __call__(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Send one request and return the answer."""
        self._socket.sendall(json.dumps({"do": do, **arguments}).encode() + b"\n")
        line = self._file.readline()
        if not line:
            raise ConnectionError("the station closed its control socket")
        answer: dict[str, Any] = json.loads(line)
        if not answer.get("ok", False):
            raise ValueError(str(answer.get("error", answer)))
        return answer

    def close(self) -> None:
        """Release the connection."""
        with suppress(OSError):
            self._file.close()
            self._socket.close()

    def __enter__(self) -> "ControlClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
