"""What survives a restart of LinuxCNC: its INI and HAL files, and how it is started again."""

import asyncio
import os
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.errors import DeviceFault, ParameterError, Refused
from drivers.linuxcnc.configuration import Ini, read, with_entries, with_pins, write_surely
from drivers.linuxcnc.link import Answer
from drivers.linuxcnc.places import Places

OF_INI = {"home_offset": "HOME_OFFSET", "home": "HOME", "backlash": "BACKLASH"}
FIRST_PIN = "genhexkins.base.0.x"


@dataclass(frozen=True)
class Stored:
    """The files of one configuration."""

    ini: Ini
    hal: Path
    places: Places
    settings: Mapping[str, Any]

    @classmethod
    def of(cls, settings: Mapping[str, Any], places: Places) -> "Stored":
        """Read the INI file and find the HAL file that holds the geometry; raises Refused."""
        ini = Ini.read(Path(settings["ini"]))
        if settings["hal"]:
            hal = Path(settings["hal"])
            read(hal)
        else:
            holding = [path for path in ini.hal_files if f" {FIRST_PIN} " in read(path)]
            if not holding:
                raise Refused(
                    f"no HAL file of it sets {FIRST_PIN}",
                    device=str(ini.path),
                    remedy="Set the pins of genhexkins in a HAL file, or name one: hal under "
                    "[controller] of the site file",
                )
            hal = holding[-1]
        return cls(ini, hal, places, settings)

    @property
    def machine(self) -> str:
        """What the INI file calls the machine: its serial number, as far as it has one."""
        return self.ini.get("EMC", "MACHINE")

    def check(self, state: Answer) -> None:
        """Refuse a LinuxCNC that runs with another INI file, or that cannot be calibrated."""
        runs = Path(state["ini"])
        if not runs.is_absolute():
            runs = self.ini.path.parent / runs
        if runs.resolve() != self.ini.path.resolve():
            self._refuse(
                f"LinuxCNC runs with {runs}",
                "Correct ini in the site file, or start LinuxCNC with the other one",
            )
        if len(state["joints"]) != len(self.places.limbs):
            self._refuse(
                f"has {len(state['joints'])} joints, the machine file {len(self.places.limbs)}",
                "Use the machine file of this machine",
            )
        if (state["mm"], state["degrees"]) != (1.0, 1.0):
            self._refuse(
                "its units are not mm and degrees",
                "Set LINEAR_UNITS = mm and ANGULAR_UNITS = degree under [TRAJ]",
            )
        for n in range(len(self.places.limbs)):
            if not self._finds_its_reference(f"JOINT_{n}"):
                self._refuse(
                    f"joint {n} is at home wherever it stands (HOME_SEARCH_VEL = 0 without an "
                    "index pulse, or an absolute encoder): its L0 cannot be found again",
                    f"Home it by a switch: HOME_SEARCH_VEL and HOME_LATCH_VEL in [JOINT_{n}], or "
                    "by the index pulse alone: HOME_SEARCH_VEL = 0, HOME_LATCH_VEL, and "
                    "HOME_USE_INDEX = YES",
                )

    def _finds_its_reference(self, section: str) -> bool:
        """Whether a joint is homed at a place of its own: a switch, or the index pulse alone."""
        if self.ini.number(section, "HOME_ABSOLUTE_ENCODER"):
            return False
        by_index = self.ini.get(section, "HOME_USE_INDEX").split("#")[0].strip().upper()
        index = by_index in ("YES", "TRUE", "1", "ON")
        latches = self.ini.number(section, "HOME_LATCH_VEL") != 0.0
        return self.ini.number(section, "HOME_SEARCH_VEL") != 0.0 or (index and latches)

    def _refuse(self, what: str, remedy: str) -> None:
        raise Refused(what, device=f"linuxcnc {self.ini.path.name}", remedy=remedy)

    def write(self, pins: Mapping[str, float]) -> None:
        """Write the values of pins into both files; raises ParameterError or Refused."""
        kept = {name: value for name, value in pins.items() if name in self.places.pins}
        geometry = {n: v for n, v in kept.items() if n.startswith("genhexkins.")}
        joints = {
            (f"JOINT_{n}", key): kept[f"ini.{n}.{what}"]
            for n in range(len(self.places.limbs))
            for what, key in OF_INI.items()
        }
        ini = with_entries(read(self.ini.path), joints)
        try:
            write_surely(self.hal, with_pins(read(self.hal), geometry))
            write_surely(self.ini.path, ini)
        except OSError as error:
            raise ParameterError(
                f"{error.filename} cannot be written ({error.strerror})",
                device="linuxcnc",
                remedy="Check who may write there; the old file stays beside it",
            ) from error

    def pins(self, now: Mapping[str, float]) -> dict[str, float]:
        """What the files would set the pins to; what they do not name stays as it is ``now``."""
        ini = Ini.read(self.ini.path)
        set_there = ini.pins()
        if self.hal not in [path.resolve() for path in ini.hal_files]:
            set_there |= Ini(ini.path, {**ini.entries, ("HAL", "HALFILE"): (str(self.hal),)}).pins()
        found = {name: set_there.get(name, now[name]) for name in self.places.pins}
        for n in range(len(self.places.limbs)):
            for what, key in OF_INI.items():
                found[f"ini.{n}.{what}"] = ini.number(f"JOINT_{n}", key)
        return found

    async def restart(self, device: str) -> None:
        """Run the command that starts LinuxCNC again; raises DeviceFault if it fails."""
        words, within_s = self.settings["restart"], self.settings["restart_s"]
        try:
            process = await asyncio.create_subprocess_exec(
                *words, stdin=DEVNULL, stdout=PIPE, stderr=STDOUT,
                env={**os.environ, **self.settings["env"]},
            )  # fmt: skip
        except OSError as error:
            raise DeviceFault(
                f"{words[0]} cannot be started ({error.strerror})",
                device=device,
                remedy="Correct restart under [controller] of the site file",
            ) from error
        try:
            async with asyncio.timeout(within_s):
                said, _ = await process.communicate()
        except TimeoutError:
            process.kill()
            await process.wait()
            said = b"it did not end in time"
        if process.returncode != 0:
            raise DeviceFault(
                f"the command that starts it again failed: {said.decode(errors='replace')[-300:]}",
                device=device,
                remedy="Start LinuxCNC by hand; what was stored is in its files",
            )
