"""Commands by request: newline-delimited JSON on a loopback TCP port. It answers and moves nothing.

A request is one JSON object on one line, UTF-8; every request gets one line back, in order, with
``ok``, and ``id`` if it had one. What to ask, and what is answered: docs/correct.md. Every client
has a history of its own, which begins at home: what it asks a command for counts as sent, unless
it says ``"keep": false``.
"""

import asyncio
import json
import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from app.errors import GateRefused
from app.jobs.corrector import Corrector
from app.plain_data import plain
from calib.arrays import Array
from calib.command import Trajectory
from calib.errors import BadInput

HOST = "127.0.0.1"
_HTTP = re.compile(rb"[A-Z]+ \S+ HTTP/|[A-Za-z-]+: ")
LONGEST_LINE = 65536
SHORT = 512
"""Bytes of a request that is answered before anybody else is heard."""
MOST_CLIENTS = 32
LARGEST = 1e9
"""Numbers beyond this, whatever their unit, are a fault of the client."""
KNOWN = ("do", "id", "pose", "poses", "channels", "time_s", "keep", "extrapolate")
KINDS = {BadInput: "input", GateRefused: "region"}


class Client:
    """What one client has asked for so far.

    Parameters
    ----------
    corrector : Corrector
    """

    def __init__(self, corrector: Corrector) -> None:
        self._corrector = corrector
        self._way = self._from_home()

    def _from_home(self) -> Trajectory:
        return Trajectory(self._corrector.identified, self._corrector.history())

    def answer(self, line: bytes) -> dict[str, Any]:
        """Answer one line; whatever is wrong with it is said in the answer."""
        request: Any = None
        try:
            request = _read(line)
            found = self._obey(request)
        except (BadInput, GateRefused) as wrong:
            kind = next(word for of, word in KINDS.items() if isinstance(wrong, of))
            found = {"ok": False, "kind": kind, "error": str(wrong)}
        if isinstance(request, dict) and isinstance(request.get("id"), str | int | float):
            found["id"] = request["id"]
        return found

    def _obey(self, request: Mapping[str, Any]) -> dict[str, Any]:
        for name in request:
            if name not in KNOWN:
                raise BadInput(f'unknown key "{name}"', remedy=f"Known: {', '.join(KNOWN)}")
        do = request.get("do", "correct")
        if do == "about":
            return {"ok": True, **self._about()}
        if do == "forget":
            self._way = self._from_home()
            return {"ok": True}
        if do == "correct":
            return {"ok": True, **self._correct(request)}
        raise BadInput(f'"do" is {do!r}', remedy="Ask for correct, about or forget")

    def _about(self) -> dict[str, Any]:
        corrector = self._corrector
        region = corrector.saved.region
        return {
            "format": "pkm-correct/1",
            "machine": corrector.machine.name,
            "model": corrector.source,
            "coordinates": list(corrector.coordinates),
            "actuators": [one.name for one in corrector.machine.actuators],
            "effects": [found.effect.id for found in corrector.identified.effects],
            "left_out": dict(corrector.left_out),
            "needs": list(corrector.identified.needs),
            "needs_time": corrector.identified.needs_time,
            "measured": None if region is None else vars(region),
            "remarks": corrector.remarks,
        }

    def _correct(self, request: Mapping[str, Any]) -> dict[str, Any]:
        corrector = self._corrector
        many = "poses" in request
        poses = _poses(request) if many else [request.get("pose")]
        tasks = [corrector.task_of(_pose(one, corrector.coordinates)) for one in poses]
        channels = _channels(request.get("channels", {}))
        time_s = _times(request.get("time_s"), len(poses) if many else 0)
        keep, extrapolate = _flag(request, "keep", True), _flag(request, "extrapolate", False)
        solved = corrector.solve(np.array(tasks).T, channels, time_s, self._way)
        names = [f"pose {k + 1}" for k in range(len(poses))] if many else ["the pose"]
        solved.check(names, extrapolate=extrapolate)
        entries = solved.entries()
        if keep:
            self._way.sent(solved.commands)
        return {"poses": entries} if many else entries[0]


def _read(line: bytes) -> dict[str, Any]:
    try:
        request = json.loads(line.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadInput(f"not JSON: {error}", remedy='Send {"pose": [...]} on one line') from error
    if not isinstance(request, dict):
        raise BadInput("not a JSON object", remedy='Send {"pose": [...]} on one line')
    return request


def _pose(value: Any, coordinates: tuple[str, ...]) -> list[float]:
    """A list of numbers, or an object with one for each coordinate."""
    if isinstance(value, dict):
        missing = [name for name in coordinates if name not in value]
        strange = [name for name in value if name not in coordinates]
        if missing or strange:
            what = f"has no {missing[0]}" if missing else f"has {strange[0]!r}"
            raise BadInput(f"the pose {what}", remedy=f"Give {', '.join(coordinates)}")
        value = [value[name] for name in coordinates]
    if not isinstance(value, list):
        raise BadInput("there is no pose", remedy=f'Send "pose": [{", ".join(coordinates)}]')
    return [_number(one, "the pose") for one in value]


def _poses(request: Mapping[str, Any]) -> list[Any]:
    """Poses that are asked for together."""
    value = request["poses"]
    if "pose" in request or not isinstance(value, list) or not value:
        raise BadInput(
            "poses is no list, or pose is there too", remedy='Send "poses": [[...], [...]]'
        )
    return value


def _times(value: Any, many: int) -> float | Array | None:
    """Time of a pose in s, or of ``many``: one for all, or a list of them."""
    if value is None:
        return None
    if not many or not isinstance(value, list):
        return _number(value, "time_s")
    if len(value) != many:
        raise BadInput(
            f"time_s has {len(value)} numbers, and there are {many} poses",
            remedy="Send one number, or one for each pose",
        )
    return np.array([_number(one, "time_s") for one in value])


def _channels(value: Any) -> dict[str, float]:
    if not isinstance(value, dict):
        raise BadInput("channels is no object", remedy='Send "channels": {"payload_kg": 5.0}')
    return {name: _number(one, name) for name, one in value.items()}


def _number(value: Any, what: str) -> float:
    good = isinstance(value, int | float) and not isinstance(value, bool)
    if not good or not abs(value) < LARGEST:
        raise BadInput(f"{what}: {str(value)[:40]} is no finite number", remedy="Send a number")
    return float(value)


def _flag(request: Mapping[str, Any], name: str, default: bool) -> bool:
    value = request.get(name, default)
    if not isinstance(value, bool):
        raise BadInput(f"{name} is {str(value)[:40]}", remedy="Send true or false")
    return value


class CorrectionServer:
    """Answers on a loopback port from :meth:`start` to :meth:`stop`."""

    def __init__(self, corrector: Corrector, port: int = 0) -> None:
        self._corrector = corrector
        self._port = port
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.Task[None]] = set()

    async def start(self) -> int:
        """Listen; returns the port. Raises BadInput if it is taken."""
        try:
            self._server = await asyncio.start_server(self._serve, HOST, self._port)
        except (OSError, OverflowError) as error:
            raise BadInput(
                f"port {self._port} of {HOST} cannot be used: {error}",
                remedy="Name another port, or 0 for any that is free",
            ) from error
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    async def stop(self) -> None:
        """Let go of the port and of every client."""
        if self._server is not None:
            self._server.close()
        for client in self._clients:
            client.cancel()
        await asyncio.gather(*self._clients, return_exceptions=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._clients.add(task)
        try:
            if len(self._clients) > MOST_CLIENTS:
                await _send(writer, _refused(f"there are {MOST_CLIENTS} clients already"))
            else:
                await self._talk(reader, writer)
        except (ConnectionError, asyncio.CancelledError):
            pass  # it went away, or the server ends
        finally:
            self._clients.discard(task)
            writer.close()
            with suppress(ConnectionError, asyncio.CancelledError):
                await writer.wait_closed()

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        client, held, overlong = Client(self._corrector), b"", False
        while data := await reader.read(LONGEST_LINE):
            *lines, held = (held + data).split(b"\n")
            for line in lines:
                if _HTTP.match(line):
                    return  # a browser: a page is no program that asks
                if overlong or len(line) > LONGEST_LINE:
                    overlong = False
                    await _send(writer, _refused(f"a line is longer than {LONGEST_LINE} bytes"))
                elif line.strip():
                    await _send(writer, await _answered(client, line))
            if len(held) > LONGEST_LINE:
                held, overlong = b"", True


async def _answered(client: Client, line: bytes) -> dict[str, Any]:
    """A short request at once: to wake a thread and be woken takes longer than a pose."""
    if len(line) <= SHORT:
        return client.answer(line)
    return await asyncio.to_thread(client.answer, line)


def _refused(why: str) -> dict[str, Any]:
    return {"ok": False, "kind": "input", "error": why}


async def _send(writer: asyncio.StreamWriter, answer: Mapping[str, Any]) -> None:
    try:
        text = json.dumps(answer, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError):  # numbers that JSON cannot say, or numpy's
        text = json.dumps(plain(answer), ensure_ascii=False)
    writer.write(text.encode("utf-8", "replace") + b"\n")
    await writer.drain()
