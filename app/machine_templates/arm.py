"""A serial arm."""

import numpy as np

from app.machine_templates.common import head, join_parts, parameter
from app.machine_templates.questions import Questions


def arm_file(name: str, ask: Questions) -> str:
    """A serial six-axis arm: one limb, all joints driven."""
    base = ask.number("shoulder_height", "height of the shoulder above the base, mm", 400.0)
    offset = ask.number("shoulder_offset", "offset of the shoulder from the first axis, mm", 25.0)
    upper = ask.number("upper_arm", "length of the upper arm, mm", 455.0)
    lower = ask.number("lower_arm", "length of the lower arm to the wrist, mm", 420.0)
    flange = ask.number("flange", "wrist to flange, mm", 80.0)
    tolerance = ask.number("tolerance", "tolerance of lengths, +- mm", 0.3)
    lengths = (
        ("a1", offset, "offset of the shoulder"),
        ("a2", upper, "upper arm"),
        ("d4", lower, "lower arm"),
    )
    parameters = [
        parameter(key, "mm", f"{tolerance:g}", f"{value:g}", says) for key, value, says in lengths
    ]
    parameters += [
        parameter(f"zero{k}", "rad", '"0.3 deg"', "0.0", f"zero of axis {k}") for k in range(2, 6)
    ]
    limits = {
        1: (-120, 120),
        2: (-90, 90),
        3: (-90, 90),
        4: (-120, 120),
        5: (5, 110),
        6: (-180, 180),
    }
    actuators = [
        f'q{k} = {{ unit = "rad", home = "{45 if k == 5 else 0} deg", '
        f'limits = ["{low} deg", "{high} deg"] }}'
        for k, (low, high) in limits.items()
    ]
    slant = flange * float(np.sqrt(0.5))
    x, z, box = offset + lower + slant, base + upper - slant, 0.08 * (upper + lower)
    return join_parts(
        head(name, "serial arm with six axes: one limb, every joint driven"),
        "# Upper arm upright, lower arm level, wrist bent by 45 deg: away from singular poses.\n"
        f'[home]\npose = {{ x = {x:.9f}, z = {z:.9f}, ry = "45 deg" }}',
        f"[workspace]\nx = [{x - box:.1f}, {x + box:.1f}]\ny = [{-box:.1f}, {box:.1f}]\n"
        f"z = [{z - box:.1f}, {z + box:.1f}]\n"
        'rx = ["-15 deg", "15 deg"]\nry = ["30 deg", "60 deg"]\nrz = ["-15 deg", "15 deg"]',
        "\n".join(["[actuators]", *actuators]),
        f"""# Up to the shoulder, out to its axis, upper arm, lower arm, the wrist, the flange.
# Add an error wherever your arm may have one: rx:skew1 behind an axis, tz:a3 between two.
[limbs.arm]
chain = \"\"\"
Rz:q1 column=tz:{base:g} tx:a1
Ry:q2+zero2 tz:a2
Ry:q3+zero3 tx:d4
Rx:q4+zero4 Ry:q5+zero5 Rx:q6 flange=tx:{flange:g}
\"\"\"

# What the parts are: these are links, they grow when the arm is warm.
[limbs.arm.traits]
grows = ["column", "a1", "a2", "d4", "flange"]""",
        "\n".join(["[limbs.arm.parameters]", *parameters]),
    )
