"""Traits of a machine file: read, told by names where none are stated, refused with a remedy."""

import re

import numpy as np
import pytest
from effects_rows import machine_of, text_of, without_traits

from app.files.machines import shipped_machines
from app.machine_templates import TEMPLATES
from app.verbs.machine import Asked
from calib.effects import catalogue, not_defined
from calib.errors import BadInput
from calib.mechanism.parse import parse_machine


@pytest.mark.parametrize("name", ["hexapod", "hexapod-universal", "tripod", "ptm"])
def test_copies_that_were_made_before_are_told_by_their_names(name: str) -> None:
    text = text_of(name)
    old = re.sub(r"(?:lower|upper|rod|spring)=", "", without_traits(text))
    stated, told = machine_of(text), machine_of(old)
    assert (stated.traits_stated, told.traits_stated) == (True, False)
    assert [limb.traits for limb in told.limbs] == [limb.traits for limb in stated.limbs]


@pytest.mark.parametrize("name", ["delta", "arm"])
def test_without_traits_and_old_names_nothing_is_asked_that_needs_them(name: str) -> None:
    machine = machine_of(without_traits(text_of(name)))
    assert not machine.traits_stated
    lacking = not_defined(machine)
    assert {"thermal-growth", "joint-offset", "joint-azimuth", "screw-twist"} <= lacking.keys()
    assert "gravity-sag" not in lacking


def test_one_table_of_traits_is_enough_to_be_taken_at_its_word() -> None:
    """A hexapod whose file says no more than that its legs grow."""
    text = re.sub(r"(base_joint|platform_joint|screw) = .*\n", "", text_of("hexapod"))
    lacking = not_defined(machine_of(text))
    assert {"joint-tilt", "screw-twist"} <= lacking.keys()
    assert "thermal-growth" not in lacking


def test_a_limb_may_have_traits_of_its_own() -> None:
    text = text_of("stewart").replace(
        '[limbs.leg1]\ntype = "leg"', '[limbs.leg1]\ntraits = { grows = "L0" }\ntype = "leg"'
    )
    first, *others = machine_of(text).limbs
    assert first.traits.grows == others[0].traits.grows
    assert first.traits.screw is None
    assert all(limb.traits.screw is not None for limb in others)


def test_names_of_a_joint_mean_its_axes_in_the_order_of_the_body() -> None:
    limb = machine_of(text_of("stewart")).limbs[0]
    base, platform = limb.traits.base_joint, limb.traits.platform_joint
    assert base is not None
    assert platform is not None
    assert base.first < base.second < platform.second < platform.first


@pytest.mark.parametrize(
    ("name", "old", "new", "says", "remedy"),
    [
        ("hexapod", 'grows = ["L0"]', 'grow = ["L0"]', 'unknown key "grow"', '"grows"'),
        ("hexapod", 'grows = ["L0"]', 'grows = ["L_0"]', 'nothing named "L_0"', "Did you mean"),
        ("hexapod", 'grows = ["L0"]', "grows = 230.7", "grows is 230.7", "a list of names"),
        ("hexapod", 'grows = ["L0"]', 'grows = ["twist"]', "is no length", "Ty:q+L0"),
        ("hexapod", 'grows = ["L0"]', 'grows = ["phi_b"]', "is no length", "Name translations"),
        ("hexapod", '["psi_B", "swing_B"]', '["swing_B", "psi_B"]', "in their order", "base"),
        ("hexapod", '["psi_P", "swing_P"]', '["swing_P", "psi_P"]', "in their order", "platform"),
        ("hexapod", '["psi_B", "swing_B"]', '["psi_B"]', "has 1 axes", "foot=Uxy"),
        ("hexapod", '["psi_B", "swing_B"]', '["psi_B", "L0"]', "is no passive turn", "foot=Uxy"),
        ("hexapod", 'screw = "twist"', 'screw = "swing_B"', "does not turn about the axis", "Ty:q"),
        ("tripod", '["dh1", "dh2"]', '["dh1"]', "names 1", '["side_a", "side_b"]'),
        ("tripod", '= "dtheta_Bz"', '= "alpha_B1"', "is no fixed turn", "rz:-corner"),
        ("tripod", 'yields = "spring"', 'yields = "h"', "is no spring", "ctz:1e-5"),
        ("delta", 'base_joint = "hook"', 'base_joint = "ball_a"', "has 3 axes", "psi"),
    ],
)  # fmt: skip
def test_faults_are_named_with_line_and_remedy(
    name: str, old: str, new: str, says: str, remedy: str
) -> None:
    text = text_of(name)
    assert old in text
    changed = text.replace(old, new, 1)
    with pytest.raises(BadInput) as caught:
        parse_machine(changed, "mine.toml")
    line = next(k for k, row in enumerate(changed.splitlines(), 1) if new in row)
    assert says in caught.value.what
    assert remedy in caught.value.remedy
    assert caught.value.place.startswith(f"mine.toml, line {line}, ")


def test_springs_that_nothing_shares_are_no_spring_under_the_weight() -> None:
    text = text_of("stewart").replace("Tz:q+L0", "Tz:q+L0 spring=ctz:1e-5")
    text = text.replace('screw = "turn"', 'screw = "turn"\nyields = "spring"')
    assert "no load that limbs share" in not_defined(machine_of(text))["gravity-sag"]


def test_legs_that_lean_on_their_joints_are_not_asked_for_tilt_and_offset() -> None:
    """The formulas hold for legs that stand square on the second axis."""
    text = text_of("stewart").replace("foot=Uxy Tz:q+L0", "foot=Uxy rx:1d Tz:q+L0 rx:-1d")
    text = text.replace('platform_joint = "head"\n', "").replace('screw = "turn"\n', "")
    lacking = not_defined(machine_of(text))
    assert "do not stand square" in lacking["joint-offset"]


@pytest.mark.parametrize("kind", [template.name for template in TEMPLATES])
def test_new_machine_files_state_traits(kind: str) -> None:
    template = next(t for t in TEMPLATES if t.name == kind)
    machine = machine_of(template.render("mine", Asked({}, quiet=True)))
    assert machine.traits_stated
    assert "thermal-growth" in {effect.id for effect in catalogue(machine)}


def test_every_shipped_machine_states_traits_that_lie_in_its_chains() -> None:
    for name in set(shipped_machines()) - {"six-stage"}:  # nobody knows what is inside of it
        machine = machine_of(text_of(name))
        assert machine.traits_stated
        for limb in machine.limbs:
            assert limb.traits.grows
            lengths = [limb.elements[k] for k in limb.traits.grows]
            assert not any(element.turns for element in lengths)
            assert np.all([len(limb.elements) > k for k in limb.traits.grows])
