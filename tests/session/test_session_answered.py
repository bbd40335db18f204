"""Actuator values that a controller answers are those of the pose, or none are taken."""

import random
import re
import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from session_mock import POSES, Mock

from app.files.machines import load_machine
from app.session.answered import (
    OFF_MM,
    OFF_RAD,
    expected_targets,
    must_be_within_reach,
    must_belong,
)
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from drivers import plausible
from drivers.errors import ProtocolError

TARGET = re.compile(rb"t(28|38)A8([0-9A-F]{16})\r")
"""The controller's answer: where two of the actuators go."""


def flipped(value: float, bit: int) -> float:
    (bits,) = struct.unpack("<Q", struct.pack("<d", value))
    return float(struct.unpack("<d", struct.pack("<Q", bits ^ 1 << bit))[0])


@pytest.mark.parametrize("name", ["hexapod", "tripod", "ptm", "delta"])
def test_every_bit_that_a_target_may_lose_is_noticed_or_small(name: str) -> None:
    machine = load_machine(name)
    dice = random.Random(name)
    held = {p.name: p.nominal + dice.uniform(-0.2, 0.2) * 1e-2 for p in machine.parameters}
    q = expected_targets(machine, held, machine.home)
    must_belong(machine, held, machine.home, q)
    for axis, actuator in enumerate(machine.actuators):
        most = OFF_RAD if actuator.unit == "rad" else OFF_MM
        for bit in range(64):
            wrong = q.copy()
            wrong[axis] = flipped(float(q[axis]), bit)
            if abs(wrong[axis] - q[axis]) <= most:
                must_belong(machine, held, machine.home, wrong)
                continue
            with pytest.raises(ProtocolError, match=re.escape(actuator.name)) as refused:
                must_belong(machine, held, machine.home, wrong)
            assert refused.value.remedy


def test_what_was_driven_past_its_limits_by_hand_is_none_of_a_broken_wire() -> None:
    machine = load_machine("hexapod")
    low, high = machine.q_limits.T
    must_be_within_reach(machine, high + 0.5 * (high - low))
    must_be_within_reach(machine, [0.0] * 6, [False] * 6)  # switched on, and not homed yet
    for beyond in (low - 1.5 * (high - low), np.full(6, np.nan), np.full(6, 1e300)):
        with pytest.raises(ProtocolError, match=r"q1.*stroke"):
            must_be_within_reach(machine, beyond)


def test_a_channel_may_be_missing_but_not_beyond_everything() -> None:
    plausible.channels({"structure_temp_C": -127.0, "air_temp_C": float("nan")}, "controller")
    with pytest.raises(ProtocolError, match=r"structure_temp_C 1e\+300"):
        plausible.channels({"structure_temp_C": 1e300}, "controller")


class Altering:
    """Between program and adapter: a digit of one target is another, from the second motion on."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._far = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self.seen = 0
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            near, _ = self._listener.accept()
            far = socket.create_connection(self._far)
            threading.Thread(target=self._carry, args=(near, far, False), daemon=True).start()
            self._carry(far, near, True)

    def _carry(self, source: socket.socket, sink: socket.socket, back: bool) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(TARGET.sub(self._altered, data) if back else data)
        sink.close()

    def _altered(self, frame: "re.Match[bytes]") -> bytes:
        self.seen += 1
        digits = bytearray(frame[2])
        if self.seen > 2:
            digits[13] = ord("3") if digits[13] != ord("3") else ord("4")  # some mm
        return b"t" + frame[1] + b"A8" + bytes(digits) + b"\r"

    def close(self) -> None:
        self._listener.close()


@pytest.mark.long
async def test_a_target_that_lost_a_digit_on_the_wire_stands_in_no_run(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    site = mock_of("--smrs", "3").site
    channel = site.controller.settings["channel"]
    wire = Altering(channel.removeprefix("socket://"))
    settings = {**site.controller.settings, "channel": f"socket://{wire.address}"}
    site = replace(site, controller=replace(site.controller, settings=settings))
    options = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False)
    plan = measure_plan(site, {label: POSES[label] for label in "ab"}, options)
    session = Session.create(site, plan, tmp_path, unattended=True)
    await session.connect()
    with pytest.raises(ProtocolError, match="as the target of q"):
        await session.run()
    held = [row.q for row in session.journal.rows()]
    await session.close()
    wire.close()
    machine = site.machine
    assert all(machine.within_stroke(np.array(q)[:, None])[0] for q in held)
