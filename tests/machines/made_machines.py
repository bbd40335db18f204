"""Machines that nobody ships: linear and rotary actuators mixed, motors behind screws."""

from importlib.resources import files

from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine

LEAD_MM = 5.0
"""Of the screws: a turn of the motor moves the carriage by this."""

GANTRY = """
format = "pkm-machine/1"
name = "gantry"
says = "three carriages, one upon the other, and a head that turns about three axes"

[home]
pose = { x = 200.0, y = 150.0, z = 100.0 }

[workspace]
x = [80.0, 320.0]
y = [60.0, 240.0]
z = [40.0, 160.0]
rx = ["-25 deg", "25 deg"]
ry = ["-25 deg", "25 deg"]
rz = ["-40 deg", "40 deg"]

[actuators]
u = { unit = "mm", home = 200.0, limits = [0.0, 400.0] }
v = { unit = "mm", home = 150.0, limits = [0.0, 300.0] }
w = { unit = "mm", home = 100.0, limits = [0.0, 200.0] }
a = { unit = "rad", home = 0.0, limits = ["-90 deg", "90 deg"] }
b = { unit = "rad", home = 0.0, limits = ["-45 deg", "45 deg"] }
c = { unit = "rad", home = 0.0, limits = ["-45 deg", "45 deg"] }

[limbs.gantry]
chain = "Tx:u rz:square Ty:v rx:plumb Tz:w Rz:a rx:skew Ry:b+zero_b ty:offset Rx:c+zero_c"

[limbs.gantry.parameters]
square = { unit = "rad", tolerance = "0.05 deg", nominal = 0.0 }
plumb = { unit = "rad", tolerance = "0.05 deg", nominal = 0.0 }
skew = { unit = "rad", tolerance = "0.05 deg", nominal = 0.0 }
zero_b = { unit = "rad", tolerance = "0.2 deg", nominal = 0.0 }
zero_c = { unit = "rad", tolerance = "0.2 deg", nominal = 0.0 }
offset = { unit = "mm", tolerance = 0.3, nominal = 0.0 }
"""


def delta_text() -> str:
    """The shipped delta."""
    return files("calib.machines").joinpath("delta.toml").read_text()


def screw_delta_text() -> str:
    """The shipped delta, its carriages moved by motors that turn."""
    text = delta_text().replace("Tz:q+zero", f"Tz:{LEAD_MM:g}mm/turn*q+zero")
    for old, turns in (
        ('unit = "mm", home', None),
        ("370.370116692", 370.370116692),
        ("[250.0, 480.0]", (250.0, 480.0)),
    ):
        if turns is None:
            new = 'unit = "rad", home'
        elif isinstance(turns, tuple):
            new = f'["{turns[0] / LEAD_MM} turn", "{turns[1] / LEAD_MM} turn"]'
        else:
            new = f'"{turns / LEAD_MM} turn"'
        text = text.replace(old, new)
    return text.replace('name = "delta"', 'name = "screw-delta"')


def gantry() -> Machine:
    """Six axes in one limb, three linear and three rotary."""
    return parse_machine(GANTRY, "gantry.toml")


def screw_delta() -> Machine:
    """Three motors in rad, three carriages in mm."""
    return parse_machine(screw_delta_text(), "screw-delta.toml")
