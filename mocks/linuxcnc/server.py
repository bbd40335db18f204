"""The controller side of a station: LinuxCNC, and the mock's true machine that follows it."""

import os
import subprocess
import threading
import time
from pathlib import Path

import numpy as np

from mocks.linuxcnc.configuration import write_configuration
from mocks.linuxcnc.program import PYTHON, LinuxCnc
from mocks.physics.hexapod import PHI_B_DEG, PHI_P_DEG
from mocks.physics.pose import rotation_z
from mocks.physics.truth import nominal_parameters
from mocks.world import World

BRIDGE = Path(__file__).with_name("bridge.py")
LOOK_S, AGAIN_S = 0.01, 0.3
STILL_MM = 1e-9
RESTART = "restart-wanted"


class LinuxCncStation:
    """LinuxCNC with the nominal parameters of a world's machine, and motors that move it.

    ``address`` is the INI file and 0: nothing listens. A file :data:`RESTART` in the folder has it
    started again; it is gone when that is done.
    """

    def __init__(self, world: World, folder: Path, serial: int) -> None:
        self._world = world
        turns = [
            tuple(tuple(map(float, rotation_z(np.radians(angle))[:, 0])) for angle in pair)
            for pair in zip(PHI_B_DEG, PHI_P_DEG, strict=True)
        ]
        folder.mkdir(parents=True, exist_ok=True)
        held = nominal_parameters(world.machine)
        ini = write_configuration(
            folder.resolve(), held, [(base, platform) for base, platform in turns], str(serial)
        )
        self.program = LinuxCnc(ini)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="linuxcnc", daemon=True)
        self._bridge: subprocess.Popen[str] | None = None

    @property
    def address(self) -> tuple[str, int]:
        """INI file."""
        return str(self.program.ini), 0

    def start(self) -> None:
        """Power on; raises OSError if LinuxCNC does not start."""
        self.program.start()
        self._thread.start()

    def stop(self) -> None:
        """Power off."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        self.program.stop()

    def cut(self, reset: bool = False) -> None:
        """Its task dies, as by a crash."""
        self.program.kill_task()

    def _follow(self) -> None:
        """Let the true machine stand where the motors do, until the end."""
        wanted = self.program.ini.parent / RESTART
        while not self._over.is_set():
            if wanted.exists():
                self._end_bridge()
                self.program.restart()
                wanted.unlink(missing_ok=True)
            try:
                self._look()
                time.sleep(LOOK_S)
            except (OSError, ValueError):  # LinuxCNC is gone, or not there yet
                self._end_bridge()
                self._over.wait(AGAIN_S)
        self._end_bridge()

    def _look(self) -> None:
        bridge = self._connected()
        assert bridge.stdin is not None
        assert bridge.stdout is not None
        bridge.stdin.write("\n")
        bridge.stdin.flush()
        motors = [float(word) for word in bridge.stdout.readline().split()]
        for leg, motor in zip(self._world.legs, motors, strict=True):
            if abs(motor - leg.target) > STILL_MM:
                leg.command(motor, 0.0)

    def _connected(self) -> "subprocess.Popen[str]":
        if self._bridge is None:
            self._bridge = subprocess.Popen(
                [PYTHON, str(BRIDGE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, text=True, env={**os.environ, **self.program.env},
            )  # fmt: skip
        return self._bridge

    def _end_bridge(self) -> None:
        bridge, self._bridge = self._bridge, None
        if bridge is not None:
            bridge.kill()
            bridge.communicate()
