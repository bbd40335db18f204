"""Six struts in the terms of LinuxCNC's genhexkins: joint centres, normals, lengths at home."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.machine_templates.common import head, join_parts, on_circle
from app.machine_templates.questions import Questions
from calib.arrays import Array
from calib.errors import BadInput
from drivers.errors import DeviceError
from drivers.linuxcnc.configuration import Ini

BASE_DEG = (15.0, 105.0, 135.0, 225.0, 255.0, 345.0)
PLATFORM_DEG = (45.0, 75.0, 165.0, 195.0, 285.0, 315.0)
BASE_MM, PLATFORM_MM, HEIGHT_MM = 180.0, 120.0, 220.0
DIGITS = 9


@dataclass(frozen=True)
class Strut:
    """Joint centres and unit normals, (3,), base and platform frame; length at the switch, mm."""

    base: Array
    platform: Array
    base_normal: Array
    platform_normal: Array
    length: float


def linuxcnc_file(name: str, ask: Questions) -> str:
    """The struts of a LinuxCNC configuration, or an example of such."""
    ini = ask.text("ini", "INI file of LinuxCNC to read them from (empty: an example)", "")
    struts = _of_ini(Path(ini)) if ini else _example()
    stroke = ask.number("stroke", "stroke of a strut, mm", 70.0)
    reach = ask.number("reach", "how far to go from home, each way, mm", 20.0)
    turn = ask.number("turn", "how far to turn, each way, deg", 12.0)
    tolerance = ask.number("tolerance", "tolerance of joint centres and lengths, +- mm", 0.3)
    parts = [_head(name, struts, stroke, reach, turn), _leg(tolerance)]
    parts += [_limb(number, strut) for number, strut in enumerate(struts, start=1)]
    return join_parts(*parts)


def _example() -> list[Strut]:
    """Struts from a circle to a smaller one; their universal joints stand radially."""
    found = []
    for below, above in zip(BASE_DEG, PLATFORM_DEG, strict=True):
        base = np.array([*np.round(BASE_MM * on_circle(below), DIGITS), -HEIGHT_MM])
        platform = np.array([*np.round(PLATFORM_MM * on_circle(above), DIGITS), 0.0])
        lower, upper = (np.array([*on_circle(degrees), 0.0]) for degrees in (below, above))
        length = round(float(np.linalg.norm(platform - base)), DIGITS)
        found.append(Strut(base, platform, lower, upper, length))
    return found


def _of_ini(path: Path) -> list[Strut]:
    """Read what the HAL files set; raises BadInput for what they do not."""
    try:
        ini = Ini.read(path)
        pins = ini.pins()
        offsets = [ini.number(f"JOINT_{n}", "HOME_OFFSET") for n in range(6)]
    except DeviceError as error:
        raise BadInput(error.what, place=str(path), remedy=error.remedy) from error
    return [
        Strut(
            _vector(pins, path, f"base.{n}"),
            _vector(pins, path, f"platform.{n}"),
            _unit(_vector(pins, path, f"base-n.{n}")),
            _unit(_vector(pins, path, f"platform-n.{n}")),
            offsets[n],
        )
        for n in range(6)
    ]


def _vector(pins: Mapping[str, float], path: Path, what: str) -> Array:
    names = [f"genhexkins.{what}.{axis}" for axis in "xyz"]
    for name in names:
        if name not in pins:
            raise BadInput(
                f"its HAL files do not set {name}",
                place=str(path),
                remedy="Set it there: a machine must not hang on what genhexkins begins with",
            )
    return np.array([pins[name] for name in names])


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _head(name: str, struts: list[Strut], stroke: float, reach: float, turn: float) -> str:
    begin = head(name, "six struts as LinuxCNC's genhexkins has them")
    lengths = [float(np.linalg.norm(strut.platform - strut.base)) for strut in struts]
    actuators = "\n".join(
        f'q{k} = {{ unit = "mm", reference = "leg{k}.L0", home = {round(length, DIGITS)!r}, '
        f"limits = [{length - stroke / 2:.3f}, {length + stroke / 2:.3f}] }}"
        for k, length in enumerate(lengths, start=1)
    )
    return f"""{begin}

# genhexkins looks for the pose from X0 Y0 Z0 when the joints have been homed, so that is home, and
# the base joints lie below.
[home]
pose = {{ z = 0.0 }}

# The box in which poses are sought; strokes and joint limits cut it further.
[workspace]
x = [{-reach:g}, {reach:g}]
y = [{-reach:g}, {reach:g}]
z = [{-reach:g}, {reach:g}]
rx = ["{-turn:g} deg", "{turn:g} deg"]
ry = ["{-turn:g} deg", "{turn:g} deg"]
rz = ["{-turn:g} deg", "{turn:g} deg"]

# q is the distance of a strut's joint centres.
[actuators]
{actuators}"""


def _leg(tolerance: float) -> str:
    lines = [
        f'{stem}_{axis} = {{ unit = "mm", tolerance = {tolerance:g}, says = "{says}, {axis}" }}'
        for stem, says in (("B", "base joint"), ("P", "platform joint"))
        for axis in "xyz"
    ]
    parameters = "\n".join(lines)
    return f"""# To the base joint; its first axis along the joint's normal, its second square on
# that and on the strut; the strut turns about itself as a screw without a guide does; the platform
# joint the other way round. A normal is x, turned by its turn about z and lifted by its rise.
# Rough angles at home in brackets.
[limb_types.leg]
chain = \"\"\"
tx:B_x ty:B_y tz:B_z rz:base_turn ry:-base_rise
psi_B=Rx(at_base) swing_B=Rz(aside_base) twist=Ry(roll)
Ty:q+L0
swing_P=Rz(aside_platform) psi_P=Rx(at_platform)
ry:platform_rise rz:-platform_turn tx:-P_x ty:-P_y tz:-P_z
\"\"\"

# What the parts are. Guided struts: leave out screw.
[limb_types.leg.traits]
grows = ["L0"]
base_joint = ["psi_B", "swing_B"]
platform_joint = ["psi_P", "swing_P"]
screw = "twist"

[limb_types.leg.parameters]
{parameters}
L0 = {{ unit = "mm", tolerance = {tolerance:g}, says = "length at the home switch" }}"""


def _limb(number: int, strut: Strut) -> str:
    centres = [
        f"{stem}_{axis} = {float(value)!r}"
        for stem, place in (("B", strut.base), ("P", strut.platform))
        for axis, value in zip("xyz", place, strict=True)
    ]
    angles = [f'{name} = "{value:.12g} deg"' for name, value in _angles(strut).items()]
    length = f"L0 = {strut.length!r}"
    return "\n".join(
        [f"[limbs.leg{number}]", 'type = "leg"', f'q = "q{number}"', *angles, length, *centres]
    )


def _angles(strut: Strut) -> dict[str, float]:
    """Directions of the normals, and the joints' angles at home, deg.

    With n = x and the strut d = (dx, dy, dz) in the joint's own axes: swing = -asin(dx),
    psi = atan2(dz, dy); those of the platform have the other sign.
    """
    along = _unit(strut.platform - strut.base)
    found = {}
    for body, normal, sign in (
        ("base", strut.base_normal, 1.0),
        ("platform", strut.platform_normal, -1.0),
    ):
        turn, rise = np.arctan2(normal[1], normal[0]), np.arcsin(np.clip(normal[2], -1.0, 1.0))
        y = np.array([-np.sin(turn), np.cos(turn), 0.0])
        z = np.cross(normal, y)
        found[f"{body}_turn"], found[f"{body}_rise"] = turn, rise
        found[f"at_{body}"] = sign * np.arctan2(along @ z, along @ y)
        found[f"aside_{body}"] = -sign * np.arcsin(along @ normal)
    second, other = (
        _unit(np.cross(normal, along)) for normal in (strut.base_normal, strut.platform_normal)
    )
    found["roll"] = np.arctan2(along @ np.cross(second, other), second @ other)
    return {name: float(np.rad2deg(value)) + 0.0 for name, value in found.items()}
