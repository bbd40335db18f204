"""Equal limbs around a circle, with joints of one's own."""

import numpy as np

from app.machine_templates.common import head, join_parts, parameter
from app.machine_templates.questions import Questions


def own_file(name: str, ask: Questions) -> str:
    """Equal limbs around a circle, each a chain that the person writes."""
    count = round(ask.number("limbs", "number of limbs, equally spaced", 3.0))
    base = ask.number("base_radius", "radius on which the limbs begin, mm", 200.0)
    platform = ask.number("platform_radius", "radius on which they end, mm", 120.0)
    height = ask.number("height", "height of the platform at home, mm", 300.0)
    lean = float(np.rad2deg(np.arctan2(platform - base, height)))
    leg = float(np.hypot(platform - base, height))
    chain = ask.text(
        "joints",
        "joints of a limb; q is its actuator (Rx turns, Tz shifts, Uxy, Sxyz; (20d) rough angle)",
        f"Ry({lean:.1f}d) Tz:q+L0 ball=Sxyz",
    )
    unit = ask.text("unit", "unit of the actuators, mm or rad", "mm")
    home = ask.number("home", "their value at home", round(leg, 9))
    stroke = ask.number("stroke", "their stroke", 100.0 if unit == "mm" else 1.5)
    task = ask.text("task", "commanded coordinates, as many as actuators", "z rx ry").split()
    tolerance = ask.number("tolerance", "tolerance of lengths, +- mm", 0.2)
    limits = f"[{home - stroke / 2:g}, {home + stroke / 2:g}]"
    length = "L0" in chain
    reference = ', reference = "limb{k}.L0"' if length else ""
    ranges = {
        "x": (-0.1 * base, 0.1 * base),
        "y": (-0.1 * base, 0.1 * base),
        "z": (height - stroke / 4 if unit == "mm" else 0.9 * height, height * 1.1),
    }
    if unit == "mm":
        ranges["z"] = (height - stroke / 4, height + stroke / 4)
    box = [
        f"{c} = [{ranges[c][0]:g}, {ranges[c][1]:g}]"
        if c in ranges
        else f'{c} = ["-8 deg", "8 deg"]'
        for c in task
    ]
    quoted = ", ".join(f'"{c}"' for c in task)
    parameters = [
        parameter("base", "mm", f"{tolerance:g}", f"{base:g}", "radius of its first joint"),
        parameter("top", "mm", f"{tolerance:g}", f"{platform:g}", "radius of its last joint"),
    ]
    if length:
        parameters.append(
            parameter("L0", "mm", f"{tolerance:g}", f"{home:.9f}", "length at zero extension")
        )
    return join_parts(
        head(name, f"{count} limbs around a circle"),
        "# Roughly where the machine stands at home: it selects the assembly branch.\n"
        f"[home]\npose = {{ z = {height:g} }}",
        "# What the machine commands: as many coordinates as there are actuators.\n"
        f"[task]\ncoordinates = [{quoted}]",
        "\n".join(["# The box in which poses are sought.", "[workspace]", *box]),
        "\n".join(
            [
                "[actuators]",
                *(
                    f'q{k} = {{ unit = "{unit}"{reference.format(k=k)}, home = {home:.9g}, '
                    f"limits = {limits} }}"
                    for k in range(1, count + 1)
                ),
            ]
        ),
        f"""# To the limb's place on the base, its joints, and back to the platform's origin.
[limb_types.limb]
chain = "rz:place tx:base {chain} tx:-top rz:-place\"""",
        *(
            [
                "# What the parts are: limbs that grow when they are warm.\n"
                '[limb_types.limb.traits]\ngrows = ["L0"]'
            ]
            if length
            else []
        ),
        "\n".join(["[limb_types.limb.parameters]", *parameters]),
        *(
            f'[limbs.limb{k}]\ntype = "limb"\nq = "q{k}"\nplace = "{360.0 * (k - 1) / count:g} deg"'
            for k in range(1, count + 1)
        ),
    )
