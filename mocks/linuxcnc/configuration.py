"""The files with which LinuxCNC runs six simulated motors under genhexkins.

A motor's position is its feedback. It counts from where its home switch is: the extension of the
strut that the mock's true machine has.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

JOINTS = range(6)
LIMITS_MM = (120.0, 360.0)
SEARCH_MM_S, LATCH_MM_S = -20.0, -0.05
"""The slower a switch is looked for the finer: a servo period is a millisecond."""

HEAD = """[EMC]
VERSION = 1.1
MACHINE = {serial}
DEBUG = 0
[DISPLAY]
DISPLAY = ./display.sh
[TASK]
TASK = milltask
CYCLE_TIME = 0.005
[RS274NGC]
PARAMETER_FILE = hexapod.var
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 4.0
SERVO_PERIOD = 1000000
[HAL]
HALFILE = hexapod.hal
[TRAJ]
COORDINATES = XYZABC
LINEAR_UNITS = mm
ANGULAR_UNITS = degree
MAX_LINEAR_VELOCITY = 1000
DEFAULT_LINEAR_VELOCITY = 1000
MAX_LINEAR_ACCELERATION = 20000
DEFAULT_LINEAR_ACCELERATION = 20000
MAX_ANGULAR_VELOCITY = 500
DEFAULT_ANGULAR_VELOCITY = 500
[EMCIO]
EMCIO = io
TOOL_TABLE = hexapod.tbl
CYCLE_TIME = 0.1
[KINS]
KINEMATICS = genhexkins
JOINTS = 6
"""
AXIS = """[AXIS_{letter}]
MIN_LIMIT = -500
MAX_LIMIT = 500
MAX_VELOCITY = 1000
MAX_ACCELERATION = 20000
"""
JOINT = """[JOINT_{n}]
TYPE = LINEAR
MIN_LIMIT = {low!r}
MAX_LIMIT = {high!r}
MAX_VELOCITY = 1000
MAX_ACCELERATION = 20000
FERROR = 5
MIN_FERROR = 1
HOME = {home!r}
HOME_OFFSET = {home!r}
HOME_SEARCH_VEL = {search!r}
HOME_LATCH_VEL = {latch!r}
HOME_FINAL_VEL = 50
HOME_USE_INDEX = NO
HOME_SEQUENCE = 0
"""
HAL = """# six motors that are where they are sent, each with a home switch below 0
loadrt genhexkins
loadrt motmod servo_period_nsec=1000000 num_joints=6
loadrt comp count=6
addf motion-command-handler servo-thread
addf motion-controller servo-thread
net estop-loop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in
"""
MOTOR = """addf comp.{n} servo-thread
net motor-{n} joint.{n}.motor-pos-cmd => joint.{n}.motor-pos-fb comp.{n}.in0
setp comp.{n}.hyst 0.0
setp comp.{n}.in1 0.0
net switch-{n} comp.{n}.out => joint.{n}.home-sw-in
"""
DISPLAY = """#!/bin/sh
# stands in for LinuxCNC's screen: it ends when the station does, or when it is told to
while [ -e running ] && kill -0 "$(cat running)" 2>/dev/null; do sleep 0.1; done
"""

Normals = Sequence[tuple[tuple[float, ...], tuple[float, ...]]]


def write_configuration(
    folder: Path, held: Mapping[str, float], normals: Normals, serial: str
) -> Path:
    """Write INI, HAL and what LinuxCNC wants beside them; returns the INI file.

    ``held`` are the parameters that the controller begins with; ``normals`` (base, platform) of
    each strut's joints.
    """
    low, high = LIMITS_MM
    limbs = [f"leg{n + 1}" for n in JOINTS]
    joints = [
        JOINT.format(
            n=n, low=low, high=high, home=held[f"{limbs[n]}.L0"], search=SEARCH_MM_S,
            latch=LATCH_MM_S,
        )
        for n in JOINTS
    ]  # fmt: skip
    axes = [AXIS.format(letter=letter) for letter in "XYZABC"]
    ini = folder / "hexapod.ini"
    ini.write_text(HEAD.format(serial=serial) + "".join(axes + joints), encoding="utf-8")
    lines = [HAL, *(MOTOR.format(n=n) for n in JOINTS)]
    for n in JOINTS:
        for body, stem, normal in (("base", "B", normals[n][0]), ("platform", "P", normals[n][1])):
            for axis, component in zip("xyz", normal, strict=True):
                place = held[f"{limbs[n]}.{stem}_{axis}"]
                lines.append(f"setp genhexkins.{body}.{n}.{axis} {place!r}\n")
                lines.append(f"setp genhexkins.{body}-n.{n}.{axis} {component!r}\n")
    lines.append("setp genhexkins.screw-lead 0.0\n")
    (folder / "hexapod.hal").write_text("".join(lines), encoding="utf-8")
    (folder / "hexapod.tbl").touch()
    (folder / "hexapod.var").touch()
    display = folder / "display.sh"
    display.write_text(DISPLAY, encoding="utf-8")
    display.chmod(0o755)
    return ini
