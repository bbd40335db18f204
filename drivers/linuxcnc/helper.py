"""What talks to LinuxCNC: a script of its own, under the Python that has LinuxCNC's modules.

Nothing of this program is imported here. A line of JSON comes in on standard input, one goes out
on standard output; the process ends with its standard input. A request names what to ``do``::

    state                          what LinuxCNC says of itself
    get    {"pins": [..]}          values of HAL pins, bit for bit
    set    {"pins": {name: v}}     set HAL pins; the values as they then are
    reset, on, off                 out of emergency stop; machine on; machine off
    home   {"joint": n}            begin to home one joint
    unhome                         forget the references of all joints
    mdi    {"line": ".."}          begin a block of G-code
    abort                          stop what moves

Every answer has ``ok``, ``alive`` (whether LinuxCNC's task runs) and ``said``, the errors that it
has reported since the last answer. Tested with LinuxCNC 2.9.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

import hal
import linuxcnc

Answer = dict[str, Any]
WAIT_S = 2.0
TASK = "milltask"
ERRORS = (linuxcnc.NML_ERROR, linuxcnc.OPERATOR_ERROR)


class Talker:
    """The channels to one LinuxCNC that runs."""

    def __init__(self) -> None:
        # HAL values are only shown to a component that has announced itself.
        self.component = hal.component(f"pkmcal-{os.getpid()}")
        self.component.ready()
        self.stat, self.command = linuxcnc.stat(), linuxcnc.command()
        self.errors = linuxcnc.error_channel()
        self.stat.poll()
        self.task = self._find_task()

    def _find_task(self) -> tuple[Path, str] | None:
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if Path(os.fsdecode(words[0])).name == TASK:
                return folder, (folder / "stat").read_text().split()[21]
        return None

    def alive(self) -> bool:
        """Whether the task that was there at the beginning still runs."""
        if self.task is None:
            return False
        folder, started = self.task
        try:
            fields = (folder / "stat").read_text().split()
        except OSError:
            return False
        return fields[21] == started and fields[2] != "Z"

    def said(self) -> list[str]:
        """Errors since the last time."""
        found = []
        while (message := self.errors.poll()) is not None:
            if message[0] in ERRORS:
                found.append(message[1].strip())
        return found

    def state(self) -> Answer:
        """What LinuxCNC says of itself; mm, degrees and joint units as its INI file has them."""
        s = self.stat
        s.poll()
        joints = [s.joint[n] for n in range(s.joints)]
        return {
            "ini": s.ini_filename,
            "estop": s.task_state == linuxcnc.STATE_ESTOP,
            "on": s.task_state == linuxcnc.STATE_ON,
            "coordinated": s.motion_mode != linuxcnc.TRAJ_MODE_FREE,
            "idle": s.interp_state == linuxcnc.INTERP_IDLE and s.exec_state == linuxcnc.EXEC_DONE,
            "in_position": bool(s.inpos),
            "homed": [bool(joint["homed"]) for joint in joints],
            "homing": [bool(joint["homing"]) for joint in joints],
            "commanded": [joint["output"] for joint in joints],
            "joints": [joint["input"] for joint in joints],
            "pose": list(s.position[:6]),
            "mm": s.linear_units,
            "degrees": s.angular_units,
        }

    def get(self, pins: list[str]) -> Answer:
        """Values of HAL pins."""
        return {"values": {name: hal.get_value(name) for name in pins}}

    def set(self, pins: dict[str, float]) -> Answer:
        """Set HAL pins, in order."""
        for name, value in pins.items():
            hal.set_p(name, repr(value))
        return self.get(list(pins))

    def _to(self, state: int) -> Answer:
        self.command.state(state)
        return {"done": self.command.wait_complete(WAIT_S) == linuxcnc.RCS_DONE}

    def _by_joints(self) -> None:
        """Joints are moved, not the platform: nothing solves for a pose."""
        self.command.mode(linuxcnc.MODE_MANUAL)
        self.command.wait_complete(WAIT_S)
        self.command.teleop_enable(0)
        self.command.wait_complete(WAIT_S)

    def reset(self) -> Answer:
        """Leave emergency stop, if what holds it lets go."""
        return self._to(linuxcnc.STATE_ESTOP_RESET)

    def on(self) -> Answer:
        """Switch the machine on, joints by themselves: poses are unknown before homing."""
        self._by_joints()
        return self._to(linuxcnc.STATE_ON)

    def off(self) -> Answer:
        """Stop, and switch the machine off."""
        self.abort()
        self._by_joints()
        return self._to(linuxcnc.STATE_OFF)

    def home(self, joint: int) -> Answer:
        """Begin to home one joint."""
        self._by_joints()
        self.command.home(joint)
        return {}

    def unhome(self) -> Answer:
        """Forget all references."""
        self._by_joints()
        self.command.unhome(-1)
        self.command.wait_complete(WAIT_S)
        return {}

    def mdi(self, line: str) -> Answer:
        """Begin a block of G-code; ``accepted`` is False where it was refused."""
        self.command.mode(linuxcnc.MODE_MDI)
        self.command.wait_complete(WAIT_S)
        self.command.mdi(line)
        # No answer for a while means that it moves.
        return {"accepted": self.command.wait_complete(0.05) != linuxcnc.RCS_ERROR}

    def abort(self) -> Answer:
        """Stop what moves."""
        self.command.abort()
        self.command.wait_complete(WAIT_S)
        return {}


VERBS = ("state", "get", "set", "reset", "on", "off", "home", "unhome", "mdi", "abort")


def answer(talker: Talker, request: Answer) -> Answer:
    """Carry one request out."""
    if request["do"] not in VERBS:
        return {"ok": False, "error": f"cannot do {request['do']!r}"}
    arguments = {name: value for name, value in request.items() if name not in ("id", "do")}
    if request["do"] != "get" and not talker.alive():
        return {"ok": False, "error": "LinuxCNC does not run any more"}
    try:
        return {"ok": True, **getattr(talker, request["do"])(**arguments)}
    except (linuxcnc.error, RuntimeError, ValueError, TypeError, NameError) as error:
        return {"ok": False, "error": str(error) or type(error).__name__}


def main() -> None:
    """Serve until the end of standard input."""
    try:
        talker = Talker()
    except (linuxcnc.error, RuntimeError, OSError, hal.error) as error:
        print(json.dumps({"ok": False, "error": str(error) or type(error).__name__}), flush=True)
        return
    alive = talker.alive()
    print(json.dumps({"ok": alive, "error": "" if alive else "LinuxCNC does not run"}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        found = answer(talker, request)
        said = talker.said() if talker.alive() else []
        print(
            json.dumps({"id": request["id"], "alive": talker.alive(), "said": said, **found}),
            flush=True,
        )


if __name__ == "__main__":
    main()
