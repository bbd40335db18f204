"""Bad machine files: each fault is named, with its place in the file and the remedy."""

import re
from importlib.resources import files

import numpy as np
import pytest

from calib.errors import BadInput
from calib.mechanism.check import require_sound
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import home_configuration


def text_of(name: str) -> str:
    return files("calib.machines").joinpath(f"{name}.toml").read_text(encoding="utf-8")


def fault_of(text: str) -> str:
    with pytest.raises(BadInput) as fault:
        require_sound(parse_machine(text, "mine.toml"), text)
    assert fault.value.remedy
    assert re.search(r"mine\.toml, line \d+", fault.value.place)
    return str(fault.value)


def changed(text: str, old: str, new: str, count: int = 1) -> str:
    assert old in text
    return text.replace(old, new, count)


def line_with(text: str, start: str) -> int:
    return next(k for k, line in enumerate(text.splitlines(), 1) if line.startswith(start))


def test_a_joint_without_an_axis() -> None:
    text = changed(text_of("hexapod"), "swing_B=Rz", "swing_B=R")
    assert '"swing_B=R" is a joint without an axis' in fault_of(text)


def test_an_actuator_that_drives_two_limbs_by_mistake() -> None:
    text = changed(text_of("hexapod"), 'q = "q2"', 'q = "q1"')
    message = fault_of(text)
    assert "actuator q2 drives no joint, while q1 drives leg1 and leg2" in message
    assert f"line {line_with(text, 'q2 =')}" in message


def test_a_chain_that_is_too_short_to_close() -> None:
    text = changed(text_of("delta"), "tz:-length_a", "tz:-length_a tz:200")
    message = fault_of(text)
    assert "does not close at home: limb tower" in message
    assert "mm and" in message


def test_a_rod_of_the_wrong_length() -> None:
    text = changed(text_of("ptm"), "tz:402 tz:3dz4", "tz:392 tz:3dz4")
    assert "from the stated home pose" in fault_of(text)


def test_a_limb_with_the_wrong_frame() -> None:
    text = text_of("hexapod")
    place = text.index("[limbs.leg4]")
    text = text[:place] + changed(text[place:], "P_x = -115.9", "P_x = 115.9")
    message = fault_of(text)
    assert "the stated home pose" in message
    assert f"line {line_with(text, '[home]')}" in message


def test_home_actuators_that_do_not_match_the_home_pose() -> None:
    text = changed(text_of("hexapod"), "home = 230.715", "home = 238.0", 6)
    message = fault_of(text)
    assert "from the stated home pose; there it needs q1 = 230.715" in message


def test_rough_angles_of_another_branch_are_put_right_by_the_home_actuators() -> None:
    """An arm of the base joint that points down at home would need legs of 240.2 to 250.1 mm."""
    text = text_of("hexapod")
    right = home_configuration(parse_machine(text, "mine.toml"))
    text = changed(text, "psi_B=Rx(90d)", "psi_B=Rx(-60d)")
    found = home_configuration(parse_machine(text, "mine.toml"))
    assert found.converged.all()
    assert np.abs(np.angle(np.exp(1j * (found.passive - right.passive)))).max() < 1e-9


def test_an_idle_freedom() -> None:
    text = changed(text_of("hexapod"), "swing_B=Rz twist=Ry(roll)", "swing_B=Rz twist=Ry(roll) Ry")
    text = changed(text, "swing_P=Rz", "")
    text = changed(text, 'platform_joint = ["psi_P", "swing_P"]', "")
    message = fault_of(text)
    assert "has an idle freedom: its joints twist, joint" in message


def test_too_many_joints() -> None:
    text = changed(text_of("hexapod"), "swing_B=Rz", "swing_B=Rz Tx Tz")
    assert "leg1 has 7 passive joints" in fault_of(text)


def test_a_platform_that_is_not_held() -> None:
    text = changed(text_of("ptm"), "theta_1=Rz\n", "theta_1=Rz Tz\n", 2)
    assert "the limbs hold 4 of the platform's 6 freedoms" in fault_of(text)


def test_redundant_rows_without_compliance() -> None:
    text = changed(text_of("ptm"), "ctx:1e-5 cty:1e-5 ctz:1e-5", "", 2)
    message = fault_of(text)
    assert (
        "1 times more than its 6 freedoms, and limb1, limb2, limb3, limb4 cannot yield" in message
    )


def test_a_compliance_that_leaves_a_wrench_rigid() -> None:
    text = changed(text_of("ptm"), "ctx:1e-5 cty:1e-5 ctz:1e-5", "ctx:1e-5")
    assert "leave it rigid against a force or couple" in fault_of(text)


def test_a_parameter_that_no_reading_can_see() -> None:
    text = changed(text_of("ptm"), "tx:2dx3 rx:90d rz:90d theta_3=Rz(42.9d)",
                   "tx:2dx3 rx:90d rz:90d theta_3=Rz(42.9d) rz:2dg3", 2)  # fmt: skip
    row = '"2dg3" = { unit = "rad", sigma = "0.1 deg", nominal = 0.0 }\n"2dx3" ='
    text = changed(text, '"2dx3" =', row, 2)
    assert "no reading can see parameter limb1.2dg3" in fault_of(text)


def test_a_workspace_out_of_reach() -> None:
    text = changed(text_of("hexapod"), "z = [200.0, 240.0]", "z = [400.0, 440.0]")
    message = fault_of(text)
    assert "none of 96 poses of the workspace can be reached" in message
    assert f"line {line_with(text, '[workspace]')}" in message


def test_a_workspace_with_a_singularity() -> None:
    """The hexapod turned about its axis until the legs no longer hold that turn."""
    text = changed(text_of("hexapod"), 'rz = ["-20 deg", "20 deg"]', 'rz = ["-20 deg", "175 deg"]')
    text = changed(text, "limits = [195.0, 265.0]", "limits = [100.0, 600.0]", 6)
    assert "the workspace contains a singularity between home and" in fault_of(text)


def test_a_home_that_is_singular() -> None:
    """Base and platform of one shape, turned alike: the platform is free to turn."""
    text = text_of("stewart")
    for b in ("x", "y"):
        places = re.findall(rf"^B_{b} = (-?[\d.]+)$", text, flags=re.M)
        for leg, place in enumerate(places, 1):
            head, _, tail = text.partition(f"[limbs.leg{leg}]")
            own = re.sub(
                rf"^P_{b} = .*$", f"P_{b} = {2 / 3 * float(place)!r}", tail, count=1, flags=re.M
            )
            text = head + f"[limbs.leg{leg}]" + own
    length = (350.0**2 + 100.0**2) ** 0.5
    text = re.sub(r"(home|L0) = 394\.\d+", rf"\1 = {length!r}", text)
    assert "home is a singular pose: the platform can turn about z" in fault_of(text)
