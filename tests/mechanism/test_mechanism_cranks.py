"""A platform on six cranks, which turn by sixty degrees: closed where loops written by hand are."""

import numpy as np

from calib.arrays import Array
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import from_euler
from calib.mechanism.solve import forward, home_configuration

CRANK, ROD = 60.0, 250.0
BASE = np.radians([-20.0, 20.0, 100.0, 140.0, 220.0, 260.0])
HEAD = np.radians([-50.0, 50.0, 70.0, 170.0, 190.0, 290.0])
FACING = BASE + np.pi * np.array([1, 0, 1, 0, 1, 0])
FEET = 180.0 * np.array([np.cos(BASE), np.sin(BASE), 0.0 * BASE])
HEADS = 110.0 * np.array([np.cos(HEAD), np.sin(HEAD), 0.0 * HEAD])


def rods(q: Array, position: Array, rotation: Array) -> Array:
    """Squared distances (6, N) from the ends of the cranks to the heads."""
    aside, up = CRANK * np.cos(q), CRANK * np.sin(q)
    turned = np.array([-np.sin(FACING)[:, None] * aside, np.cos(FACING)[:, None] * aside, up])
    at = position[:, None] + np.einsum("ijn,jk->ikn", rotation, HEADS)
    return np.asarray(np.sum((at - FEET[:, :, None] - turned) ** 2, axis=0))


HOME = float(np.sqrt(ROD**2 - rods(np.zeros((6, 1)), np.zeros((3, 1)), np.eye(3)[..., None])[0, 0]))
TEXT = f"""
format = "pkm-machine/1"
name = "cranks"
says = "six cranks with rods"
[home]
pose = {{ z = {HOME!r} }}
[workspace]
x = [-28.0, 28.0]
y = [-28.0, 28.0]
z = [{HOME - 22.0}, {HOME + 22.0}]
rx = ["-7.5 deg", "7.5 deg"]
ry = ["-7.5 deg", "7.5 deg"]
rz = ["-7.5 deg", "7.5 deg"]
[actuators]
""" + "".join(
    f'q{k} = {{ unit = "rad", home = 0.0, limits = ["-75 deg", "75 deg"] }}\n' for k in range(1, 7)
)
TEXT += """[limb_types.leg]
chain = "tx:B_x ty:B_y rz:facing Rx:q+zero ty:60 foot=Uxy tz:250 turn=Rz head=Uxy tx:-P_x ty:-P_y"
[limb_types.leg.parameters]
zero = { unit = "rad", tolerance = "0.2 deg", nominal = 0.0 }
"""
for leg in range(6):
    TEXT += f"""[limbs.leg{leg + 1}]
type = "leg"
q = "q{leg + 1}"
facing = {float(FACING[leg])!r}
B_x = {float(FEET[0, leg])!r}
B_y = {float(FEET[1, leg])!r}
P_x = {float(HEADS[0, leg])!r}
P_y = {float(HEADS[1, leg])!r}
"""


def commands(position: Array, rotation: Array) -> Array:
    """Cranks (6, N) that close the loops there, by Newton from home; nan where none do."""
    q = np.zeros((6, position.shape[1]))
    for _ in range(60):
        slope = (rods(q + 1e-6, position, rotation) - rods(q - 1e-6, position, rotation)) / 2e-6
        q -= np.clip((rods(q, position, rotation) - ROD**2) / slope, -0.2, 0.2)
    left = np.abs(rods(q, position, rotation) - ROD**2).max(axis=0)
    return np.where((left < 1e-6) & (np.abs(q).max(axis=0) < 1.25), q, np.nan)


def test_cranks_that_turn_far_close_as_they_are_assembled() -> None:
    machine = parse_machine(TEXT, "cranks.toml")
    assert home_configuration(machine).converged.all()
    rng = np.random.default_rng(9)
    position = rng.uniform(-1.0, 1.0, (3, 2500)) * np.array([[28.0], [28.0], [22.0]])
    position[2] += HOME
    rotation = from_euler(*np.radians(rng.uniform(-7.5, 7.5, (3, 2500))))
    q = commands(position, rotation)
    there = np.isfinite(q[0])
    assert there.sum() > 1000
    found = forward(machine, q[:, there])
    assert found.converged.all()
    assert np.abs(found.poses.position - position[:, there]).max() < 1e-6
    lone = np.abs(q[:, there]).max(axis=0) > 1.0
    one = [forward(machine, column[:, None]).poses.position[:, 0] for column in q[:, there].T[lone]]
    assert np.abs(np.array(one).T - position[:, there][:, lone]).max() < 1e-6
