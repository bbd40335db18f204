"""A platform on six legs."""

import numpy as np

from app.machine_templates.common import head, join_parts, on_circle
from app.machine_templates.questions import Questions


def hexapod_file(name: str, ask: Questions) -> str:
    """Six legs that grow, universal joints below and ball joints above (6-UPS)."""
    base = ask.number("base_radius", "radius of the circle of base joints, mm", 300.0)
    platform = ask.number("platform_radius", "radius of the circle of platform joints, mm", 200.0)
    base_gap = ask.number("base_gap", "angle between the two joints of a base pair, deg", 24.0)
    platform_gap = ask.number(
        "platform_gap", "angle between two joints of a platform pair, deg", 24.0
    )
    height = ask.number("height", "height of the platform at home, mm", 350.0)
    stroke = ask.number("stroke", "stroke of a leg, mm", 120.0)
    tolerance = ask.number("tolerance", "tolerance of joint centres and leg lengths, +- mm", 0.2)
    middle_base, middle_top = np.array([0.0, 120.0, 240.0]), np.array([60.0, 180.0, 300.0])
    below = np.sort(np.concatenate([middle_base - base_gap / 2, middle_base + base_gap / 2]) % 360)
    above = np.concatenate([middle_top - platform_gap / 2, middle_top + platform_gap / 2]) % 360
    # Each base joint serves the nearest platform joint that is free.
    pairs, free = [], list(np.sort(above))
    for angle in below:
        nearest = min(free, key=lambda a: abs((a - angle + 180.0) % 360.0 - 180.0))
        free.remove(nearest)
        pairs.append((angle, nearest))
    legs = []
    for k, (b, p) in enumerate(pairs, start=1):
        B, P = base * on_circle(b), platform * on_circle(p)
        length = float(np.sqrt(np.sum((B - P) ** 2) + height**2))
        legs.append((k, B, P, length))
    parts = [
        head(name, "six legs that grow between universal joints below and ball joints above"),
        f"""# Where the machine stands at home: it selects the assembly branch.
[home]
pose = {{ z = {height:g} }}

# The box in which poses are sought; strokes and joint limits cut it further.
[workspace]
x = [{-0.2 * base:g}, {0.2 * base:g}]
y = [{-0.2 * base:g}, {0.2 * base:g}]
z = [{height - 0.35 * stroke:g}, {height + 0.35 * stroke:g}]
rx = ["-10 deg", "10 deg"]
ry = ["-10 deg", "10 deg"]
rz = ["-12 deg", "12 deg"]

# q is the length of a leg between its joint centres, as the controller knows it.
[actuators]""",
    ]
    parts[-1] += "".join(
        f'\nq{k} = {{ unit = "mm", reference = "leg{k}.L0", home = {length:.6f}, '
        f"limits = [{length - stroke / 2:.3f}, {length + stroke / 2:.3f}] }}"
        for k, _, _, length in legs
    )
    parts.append(
        f"""# To the base joint; lean about x, then about y; the leg; the ball joint; back to the
# platform's origin. Small letters are fixed, capitals are joints; Sxyz spells a ball joint.
[limb_types.leg]
chain = "tx:B_x ty:B_y tz:B_z foot=Uxy Tz:q+L0 ball=Sxyz tx:-P_x ty:-P_y tz:-P_z"

# What the parts are: a leg that grows when it is warm, on a universal joint. A leg that is a screw
# without a guide, under a second universal joint: turn=Rz head=Uxy in place of the ball joint, then
# platform_joint = "head" and screw = "turn".
[limb_types.leg.traits]
grows = ["L0"]
base_joint = "foot"

# Everything that a calibration may find, with the tolerance of its manufacture (+-).
[limb_types.leg.parameters]
B_x = {{ unit = "mm", tolerance = {tolerance:g}, says = "base joint, x" }}
B_y = {{ unit = "mm", tolerance = {tolerance:g}, says = "base joint, y" }}
B_z = {{ unit = "mm", tolerance = {tolerance:g}, says = "base joint, z", nominal = 0.0 }}
P_x = {{ unit = "mm", tolerance = {tolerance:g}, says = "platform joint, x" }}
P_y = {{ unit = "mm", tolerance = {tolerance:g}, says = "platform joint, y" }}
P_z = {{ unit = "mm", tolerance = {tolerance:g}, says = "platform joint, z", nominal = 0.0 }}
L0 = {{ unit = "mm", tolerance = {tolerance:g}, says = "leg length at zero extension" }}"""
    )
    parts += [
        f"""[limbs.leg{k}]
type = "leg"
q = "q{k}"
L0 = {length:.6f}
B_x = {B[0]:.6f}
B_y = {B[1]:.6f}
P_x = {P[0]:.6f}
P_y = {P[1]:.6f}"""
        for k, B, P, length in legs
    ]
    return join_parts(*parts)
