"""Closures by name, machines with hidden parameters, limbs of several chains."""

from importlib.resources import files

import numpy as np
import pytest

from calib.errors import BadInput
from calib.mechanism.check import require_sound
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import pose_difference
from calib.mechanism.solve import forward, home_configuration, inverse
from calib.mechanism.variants import closure_names, with_closure


def text_of(name: str) -> str:
    return files("calib.machines").joinpath(f"{name}.toml").read_text(encoding="utf-8")


def machine(name: str, old: str = "", new: str = "") -> Machine:
    text = text_of(name)
    assert old in text
    return parse_machine(text.replace(old, new) if old else text, f"{name}.toml")


def test_closures_are_listed_and_an_unknown_one_is_refused() -> None:
    assert closure_names(machine("ptm")) == ["LS", "D1", "D2", "D3", "D4"]
    with pytest.raises(BadInput, match="It has LS, D1, D2, D3, D4 beside its own"):
        with_closure(machine("ptm"), "D5")
    with pytest.raises(BadInput, match="It has none"):
        with_closure(machine("hexapod"), "LS")


@pytest.mark.parametrize(
    ("old", "new", "closure", "says"),
    [
        ('release = ["limb3"]', 'release = ["limb33"]', "D3", 'Did you mean "limb3"'),
        ('release = ["limb3"]', 'released = ["limb3"]', "D3", 'Did you mean "release"'),
        ('at = "theta_2" }]\nlimb2', 'at = "theta_9" }]\nlimb2', "LS", "theta_9"),
        ('limb1 = [{ idle = "6da5" }, ', "limb1 = [", "LS", "carries 2 wrenches, 1 rows"),
        (', at = "theta_2" }]\nlimb2', " }]\nlimb2", "LS", "do not name three joints"),
    ],
)
def test_a_closure_wrongly_described(old: str, new: str, closure: str, says: str) -> None:
    with pytest.raises(BadInput, match=says):
        with_closure(machine("ptm", old, new), closure)


@pytest.mark.parametrize("closure", ["D1", "D2", "D3", "D4"])
def test_a_released_limb_holds_only_what_its_motor_holds(closure: str) -> None:
    released = with_closure(machine("ptm"), closure)
    limb = f"limb{closure[1]}"
    there = home_configuration(released)
    columns = pose_jacobians(released, there).parameters[:, :, 0]
    felt = [
        p.name
        for p, c in zip(released.parameters, columns, strict=True)
        if p.name.startswith(limb) and np.abs(c).max() > 1e-12
    ]
    assert bool(felt) == (closure in ("D1", "D2"))


def test_a_stiffer_and_a_softer_machine_share_alike() -> None:
    """Only ratios of compliances matter for the geometry."""
    own, soft = machine("ptm"), machine("ptm", ":1e-5", ":1e-3")
    errors = own.prior_sigma * np.random.default_rng(1).normal(size=83)
    q = np.array([[0.2], [-0.1]])
    one, two = forward(own, q, errors), forward(soft, q, errors)
    assert np.abs(pose_difference(one.poses, two.poses)).max() < 1e-9


def test_a_softer_joint_takes_more_of_what_does_not_fit() -> None:
    stiff = machine("ptm")
    place = text_of("ptm").replace(
        '[limbs.limb3]\ntype = "passive"', '[limbs.limb3]\ntype = "soft"'
    )
    start, end = place.index("[limb_types.passive]"), place.index("# Equation (11)")
    soft_type = place[start:end].replace("limb_types.passive", "limb_types.soft")
    text = place.replace("# Equation (11)", soft_type.replace(":1e-5", ":1e3") + "# Equation (11)")
    soft = parse_machine(text, "soft.toml")
    released = with_closure(stiff, "D3")
    pose = np.array([[0.26], [0.35]])
    a, b = (pose_jacobians(m, inverse(m, pose)).parameters[: 2 * 19 + 18] for m in (soft, released))
    assert np.abs(a - b).max() < 1e-6 * np.abs(b).max()


def test_detailed_machine_has_the_hidden_parameters_and_the_same_configurations() -> None:
    plain = machine("tripod")
    whole = plain.detailed
    assert whole is not None
    assert [p.name for p in whole.parameters[:9]] == [p.name for p in plain.parameters]
    there = inverse(plain, np.array([[10.0], [-5.0], [-130.0]]))
    again = forward(whole, there.extension, start=there)
    assert again.iterations[0] <= 2
    assert np.abs(again.poses.position - there.poses.position).max() < 1e-9
    columns = pose_jacobians(whole, there).parameters[:9]
    assert columns == pytest.approx(pose_jacobians(plain, there).parameters, abs=1e-12)


def test_two_chains_of_a_limb_share_its_parameters() -> None:
    delta = machine("delta")
    assert [limb.name for limb in delta.limbs] == [f"tower{i}" for i in (1, 1, 2, 2, 3, 3)]
    assert len(delta.parameters) == 21


def test_a_box_reachable_in_its_middle_only_is_not_refused() -> None:
    text = text_of("hexapod")
    for old, new in (("25.0, 25.0", "250.0, 250.0"), ("[200.0, 240.0]", "[50.0, 390.0]"),
                     ("-15 deg", "-80 deg"), ('"15 deg"]', '"80 deg"]')):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    assert require_sound(parse_machine(text, "wide.toml"), text).usable.any()
