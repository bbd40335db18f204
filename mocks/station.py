"""A mock station as a process of its own: ``pkmcal mock hexapod --json``.

It prints its addresses and runs until SIGINT, SIGTERM or (``--until-stdin-closes``) the end of
its standard input. With ``--json`` the one line on standard output is::

    {"format": "pkm-mock/1", "machine": "hexapod", "can": "socket://127.0.0.1:PORT",
     "tracker": "127.0.0.1:PORT", "control": "127.0.0.1:PORT", "scale": 120.0,
     "site": {...}, "site_file": "..." or null}

A machine whose controller speaks GCS has ``gcs`` (``socket://127.0.0.1:PORT``) and ``serial_port``
(the name of a pseudo-terminal, or "") instead of ``can``. ``site`` is the content of a site file
(pkm-site/1) for this station.
"""

import argparse
import asyncio
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from calib.errors import BadInput
from mocks.arguments import parser
from mocks.canopen.bare_site import bare_site
from mocks.canopen.server import CanopenStation
from mocks.clock import ScaledClock
from mocks.control import ControlServer, Hands
from mocks.gauge import GaugeMock, GaugeServer
from mocks.gcs.server import GcsStation
from mocks.geocom.instrument import SERIAL as STATION_SERIAL
from mocks.geocom.server import GeoComServer
from mocks.hidden.table import Hidden
from mocks.linuxcnc.body import StrutsBody
from mocks.linuxcnc.server import LinuxCncStation
from mocks.linuxcnc.site import linuxcnc_site
from mocks.own_files import OwnFiles, own_files, own_machine
from mocks.physics.hexapod import HOME_Z
from mocks.physics.truth import (
    draw_parameters,
    machine_file,
    read_parameters,
)
from mocks.tracker.instrument import SERIAL
from mocks.tracker.lines import LineServer
from mocks.tracker.server import TrackerServer
from mocks.world import World, WorldPlan

CONTROLLER_NODE = 10
ON_GCS = ("tripod",)
"""Machines whose controller speaks GCS; the others are on CANopen."""
POSE_SITE = {
    "rotation": "Rx Ry Rz", "angle_unit": "deg", "system": "ZERO",
    "origin": [0.0, 0.0, HOME_Z], "pivot": [0.0, 0.0, 0.0],
}  # fmt: skip
"""How a closed hexapod's poses are to be read."""
LINES_SIGMA_MM = 0.006
STATION_LIMITS = {"base_fit_mm": 0.6, "drift_mm": 0.8, "two_face_mm": 1.5}
"""What is normal with a total station, whose readings are good to 0.3 mm."""
FRAME_ERROR_MM, FRAME_ERROR_RAD = 3.0, 0.003
PATIENCE_S = 2.5
"""Silence of a mock controller that is a fault: on a busy computer its heartbeats come late."""


class MockStation:
    """World, motion controller, tracker and control socket of one mock machine."""

    def __init__(
        self,
        world: World,
        clock: ScaledClock,
        nvm: Path | None = None,
        ports: tuple[int, int, int] = (0, 0, 0),
        serial: int | None = None,
        lines: bool = False,
        pose: bool = False,
        bare: bool = False,
        own: OwnFiles | None = None,
        linuxcnc: Path | None = None,
        geocom: bool = False,
        gauge: str | None = None,
    ) -> None:
        self.world = world
        self.clock = clock
        self.pose = pose
        self.own = own
        self.serial = serial if serial is not None else _serial(nvm)
        host = "127.0.0.1"
        self.controller: CanopenStation | GcsStation | LinuxCncStation = (
            LinuxCncStation(world, linuxcnc, self.serial)
            if linuxcnc is not None
            else GcsStation(world, nvm, host, ports[0], True, self.serial, pose)
            if pose or world.kind in ON_GCS
            else CanopenStation(
                world, nvm, host, ports[0], self.serial, bare, own.eds if own else None
            )
        )
        self.tracker = TrackerServer(world, clock, host, ports[1])
        self.lines = LineServer(world, clock, host) if lines else None
        self.total_station = GeoComServer(world, clock, host) if geocom else None
        self.gauge = GaugeServer(GaugeMock(world, clock, gauge), host) if gauge else None
        hands = Hands(
            world, self.tracker, self.controller, self.gauge.gauge if self.gauge else None
        )
        self.control = ControlServer(hands, host, ports[2])

    async def start(self) -> None:
        """Power on."""
        await asyncio.to_thread(self.controller.start)
        await self.tracker.start()
        if self.lines is not None:
            await self.lines.start()
        if self.total_station is not None:
            await self.total_station.start()
        if self.gauge is not None:
            await self.gauge.start()
        await self.control.start()

    async def stop(self) -> None:
        """Power off."""
        await self.control.stop()
        if self.lines is not None:
            await self.lines.stop()
        if self.total_station is not None:
            await self.total_station.stop()
        if self.gauge is not None:
            await self.gauge.stop()
        await self.tracker.stop()
        await asyncio.to_thread(self.controller.stop)

    @property
    def channel(self) -> str:
        """The controller on TCP, as python-can names an adapter and pyserial a port."""
        host, port = self.controller.address
        return f"socket://{host}:{port}"

    def announcement(self, site_file: Path | None = None) -> dict[str, Any]:
        """What the station says of itself."""
        return {
            "format": "pkm-mock/1",
            "machine": self.world.machine.name,
            **self._lines(),
            "tracker": self.tracker.address,
            "control": self.control.address,
            "scale": self.clock.scale,
            "site": self.site(),
            "site_file": None if site_file is None else str(site_file),
        }

    def _lines(self) -> dict[str, str]:
        """Where the controller can be reached."""
        if isinstance(self.controller, GcsStation):
            return {"gcs": self.channel, "serial_port": self.controller.pty_path}
        if isinstance(self.controller, LinuxCncStation):
            return {"ini": self.controller.address[0]}
        return {"can": self.channel}

    def _controller_site(self) -> dict[str, Any]:
        if isinstance(self.controller, GcsStation):
            port = self.controller.pty_path or self.channel
            return {"kind": "pose", "port": port, **POSE_SITE} if self.pose else {
                "kind": "gcs", "port": port,
            }  # fmt: skip
        if isinstance(self.controller, LinuxCncStation):
            return linuxcnc_site(self.controller.program)
        if self.controller.controller is None:
            return bare_site(self.world, self.channel, self.controller.serials)
        eds = {"eds": str(self.own.eds)} if self.own else {}
        return {
            "kind": "canopen", "interface": "slcan", "channel": self.channel,
            "node": CONTROLLER_NODE, "silence_s": PATIENCE_S, **eds,
        }  # fmt: skip

    def _tracker_site(self) -> dict[str, Any]:
        if self.lines is not None:
            return {
                "kind": "line-stream", "address": self.lines.address, "sigma_mm": LINES_SIGMA_MM,
            }  # fmt: skip
        if self.total_station is not None:
            return {
                "kind": "geocom", "port": self.total_station.address, "serial": str(STATION_SERIAL),
                "sigma_arcsec": 0.6, "sigma_distance_mm": 0.26, "reflector": "mini",
            }  # fmt: skip
        return {
            "kind": "emscon", "address": self.tracker.address, "serial": str(SERIAL),
            "model": "AT901-LR", "reflector": "CCR-1.5in",
        }  # fmt: skip

    def site(self) -> dict[str, Any]:
        """A site file for this station, without its ``format``."""
        plan, around, load = self.world.plan, self.world.around, self.world.load
        return {
            "title": f"mock {self.world.machine.name}, seed {plan.seed}",
            "machine": str(self.own.machine) if self.own else self.world.machine.name,
            "controller": {"serial": str(self.serial), **self._controller_site()},
            **self._measuring(),
            "nests": {
                "platform": {k: list(v) for k, v in around.platform_nests.items()},
                "base": {k: list(v) for k, v in around.base_nests.items()},
            },
            "hands": {
                "kind": "mock", "control": self.control.address, "smrs": plan.smrs,
                "base_smrs": plan.base_smrs,
            },
            "load": {
                "gravity": list(load.gravity),
                "platform_mass_kg": load.platform_mass_kg,
                "platform_com": list(load.platform_com),
                "payload_com": list(load.payload_com),
                **self._told_payload(),
            },
            **({} if self.total_station is None else {"limits": dict(STATION_LIMITS)}),
            "clock": {"scale": self.clock.scale},
        }  # fmt: skip

    def _measuring(self) -> dict[str, Any]:
        """What measures: the tracker, or a gauge instead."""
        if self.gauge is not None:
            return self.gauge.site()
        return {"tracker": {**self._tracker_site(), "frame": self._rough_frame()}}

    def _told_payload(self) -> dict[str, float]:
        """The payload that somebody has weighed, where no controller tells it."""
        bare = isinstance(self.controller, CanopenStation) and self.controller.controller is None
        return {"payload_kg": self.world.payload_kg} if self.pose or bare else {}

    def _rough_frame(self) -> list[float]:
        """The base frame in the tracker frame as somebody has measured it with a tape."""
        rng = np.random.default_rng([self.world.plan.seed, 5])
        wrong = [FRAME_ERROR_MM] * 3 + [FRAME_ERROR_RAD] * 3
        exact = self.world.station.frame()
        return [round(f + w * float(rng.normal()), 4) for f, w in zip(exact, wrong, strict=True)]


def _serial(nvm: Path | None) -> int:
    """Serial number of the controller: as lasting as its memory.

    A program that remembers what it wrote to a controller must not expect it in another one, so a
    new memory is a new controller. The number stands in a file beside the memory's.
    """
    fresh = int(time.time() * 10.0) % 10**8
    if nvm is None:
        return fresh
    label = nvm.with_name(nvm.name + ".serial")
    if not label.exists():
        label.write_text(str(fresh), encoding="ascii")
    return int(label.read_text(encoding="ascii"))


def hidden_of(options: argparse.Namespace) -> Hidden:
    """What is wrong with the machine: a file's table, and over it what was typed."""
    hidden = Hidden.read(options.hidden) if options.hidden is not None else Hidden()
    return Hidden({**hidden.values, **dict(options.effect)})


def build(options: argparse.Namespace) -> MockStation:
    """Make the station that the command line asks for; raises ValueError or OSError."""
    own = own_files(options.machine, options.eds, options.bare)
    body = StrutsBody() if options.linuxcnc is not None else None
    machine = body.machine if body else own_machine(own) if own else machine_file(options.machine)
    parameters: Mapping[str, float] = (
        read_parameters(options.truth, machine)
        if options.truth is not None
        else draw_parameters(machine, options.seed)
    )
    plan = WorldPlan(
        seed=options.seed,
        parameters=parameters,
        hidden=hidden_of(options),
        smrs=options.smrs,
        base_smrs=not options.no_base_smrs,
        machine=options.machine,
        own=machine if own else None,
        body=body,
        noise_tau_s=options.noise_tau,
    )
    clock = ScaledClock(options.scale)
    world = World(clock, plan)
    world.payload_kg = options.payload
    ports = (options.controller_port, options.tracker_port, options.control_port)
    if not options.noise_tau > 0.0:
        raise ValueError(f"--noise-tau is {options.noise_tau:g} s; give a time of more than 0 s")
    if options.pose and options.machine != "hexapod":
        raise ValueError(f"there is no closed controller (--pose) of the {options.machine}")
    if options.bare and (options.pose or world.kind in ON_GCS):
        raise ValueError(f"there are no drives alone (--bare) of the {options.machine} on GCS")
    if options.linuxcnc is not None and (
        options.bare or options.pose or options.machine != "hexapod"
    ):
        raise ValueError("LinuxCNC (--linuxcnc) moves a hexapod, and holds its parameters itself")
    return MockStation(
        world, clock, options.nvm, ports, options.serial, options.lines, options.pose,
        options.bare, own, options.linuxcnc, options.geocom, options.gauge,
    )  # fmt: skip


async def run(options: argparse.Namespace) -> None:
    """Start, announce, wait for the end, stop."""
    station = build(options)
    loop, over = asyncio.get_running_loop(), asyncio.Event()

    def end(*_: object) -> None:
        loop.call_soon_threadsafe(over.set)

    for name in ("SIGINT", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), end)
    if options.until_stdin_closes:
        threading.Thread(target=_watch_stdin, args=(end,), daemon=True).start()
    await station.start()
    try:
        if options.site is not None:
            site = tomli_w.dumps({"format": "pkm-site/1", **station.site()})
            options.site.write_text(site, encoding="utf-8")
        _announce(station.announcement(options.site), options.json)
        await over.wait()
    finally:
        await station.stop()


def _announce(announcement: Mapping[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(announcement), flush=True)
        return
    for name, value in announcement.items():
        if name not in ("format", "site"):
            print(f"{name:12s} {value}", flush=True)


def _watch_stdin(end: Callable[[], None]) -> None:
    while os.read(sys.stdin.fileno(), 4096):
        pass
    end()


def main(argv: list[str] | None = None) -> int:
    """Run a station; exit code 2 for bad input, 3 if a port is taken."""
    options = parser().parse_args(argv)
    try:
        asyncio.run(run(options))
    except (ValueError, BadInput) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2 if error.filename else 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
