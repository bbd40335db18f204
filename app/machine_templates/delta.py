"""Three carriages on towers, two rods each."""

import numpy as np

from app.machine_templates.common import head, join_parts, parameter
from app.machine_templates.questions import Questions


def delta_file(name: str, ask: Questions) -> str:
    """Three carriages on towers, two parallel rods each."""
    radius = ask.number("tower_radius", "distance of a tower from the middle, mm", 160.0)
    effector = ask.number(
        "effector_radius", "distance of the rods' ends from the effector's middle, mm", 30.0
    )
    rod = ask.number("rod_length", "length of a rod, mm", 300.0)
    apart = ask.number("rod_spacing", "distance between the two rods of a tower, mm", 50.0)
    height = ask.number("height", "height of the effector at home, mm", 100.0)
    stroke = ask.number("stroke", "stroke of a carriage, mm", 230.0)
    tolerance = ask.number("tolerance", "tolerance of lengths, +- mm", 0.3)
    inward = radius - effector
    if not 0.0 < inward < rod:
        inward = 0.5 * rod
    carriage = height + float(np.sqrt(rod**2 - inward**2))
    lean = float(np.rad2deg(np.arcsin(inward / rod)))
    reach = 0.35 * radius
    towers = []
    for k, azimuth in enumerate((0.0, 120.0, 240.0), start=1):
        towers.append(
            "\n".join(
                [
                    parameter(
                        f'"tower{k}.radius"', "mm", f"{tolerance:g}", f"{radius:g}", "radius"
                    ),
                    parameter(
                        f'"tower{k}.azimuth"', "rad", '"0.2 deg"', f'"{azimuth:g} deg"', "azimuth"
                    ),
                    parameter(
                        f'"tower{k}.zero"', "mm", f"{tolerance:g}", "0.0", "carriage when q is 0"
                    ),
                ]
            )
        )
    rods = []
    for k, azimuth in enumerate((0, 120, 240), start=1):
        for letter, side in (("a", apart / 2), ("b", -apart / 2)):
            rods.append(
                f"""[limbs.rod{k}{letter}]
type = "rod"
q = "q{k}"
side = {side:g}
corner = "{azimuth} deg"
radius = "tower{k}.radius"
azimuth = "tower{k}.azimuth"
zero = "tower{k}.zero\""""
            )
    limits = f"[{carriage - stroke / 2:.3f}, {carriage + stroke / 2:.3f}]"
    actuators = "".join(
        f'\nq{k} = {{ unit = "mm", home = {carriage:.9f}, limits = {limits} }}' for k in (1, 2, 3)
    )
    return join_parts(
        head(name, "three carriages on towers move an effector that does not turn"),
        f"[home]\npose = {{ z = {height:g} }}",
        "# What the machine commands: as many coordinates as there are actuators.\n"
        '[task]\ncoordinates = ["x", "y", "z"]',
        f"[workspace]\nx = [{-reach:g}, {reach:g}]\ny = [{-reach:g}, {reach:g}]\n"
        f"z = [{height - 0.2 * stroke:g}, {height + 0.2 * stroke:g}]",
        f"# Height of the carriages above the base.\n[actuators]{actuators}",
        "# What both rods of a tower share stands here, once.\n[parameters]\n" + "\n".join(towers),
        f"""# To the tower, up to the carriage, aside to the rod; it hangs from a universal joint
# and leans inwards (its rough angle at home stands in brackets); ball joint; back to the middle.
[limb_types.rod]
chain = \"\"\"
rz:azimuth tx:radius Tz:q+zero ty:side
hook=Uxy(0,{lean:.2f}d) tz:-length ball=Sxyz(0,{-lean:.2f}d)
ty:-side tx:-{effector:g} rz:-corner
\"\"\"

# What the parts are: a rod that grows when it is warm, on a universal joint.
[limb_types.rod.traits]
grows = ["length"]
base_joint = "hook"

[limb_types.rod.parameters]
length = {{ unit = "mm", tolerance = {tolerance:g}, nominal = {rod:g} }}""",
        *rods,
    )
