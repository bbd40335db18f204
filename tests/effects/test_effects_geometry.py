"""Effects that hang on traits, against the same machine built otherwise: no formula in common."""

import re
from dataclasses import replace

import numpy as np
import pytest
from effects_rows import machine_of, moved, predicted, rows_of, text_of, without_traits

from calib.effects import effect_named, not_defined
from calib.mechanism.description import Machine
from calib.mechanism.solve import forward, home_configuration
from calib.runs.stack import Rows

WARM_C = 27.0


def warm(rows: Rows) -> Rows:
    return replace(rows, channels={"structure_temp_C": np.full(rows.count, WARM_C)})


def grown(text: str, numbers: str, growth: float) -> Machine:
    """The machine with some of its numbers larger by a share."""
    return machine_of(
        re.sub(numbers, lambda m: f"{m[1]}{float(m[2]) * (1.0 + growth)!r}", without_traits(text))
    )


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("delta", r"(length_[ab] = .*nominal = )([\d.]+)"),
        ("arm", r"(tz:|tx:|(?:a1|a2|a3|d4) = .*nominal = )(400|80|25.0|455.0|35.0|420.0)\b"),
        ("tripod", r"(\nh = .*nominal = )([\d.]+)"),
        ("ptm", r"(t[xyz]:-?)(308|75|119.2630914151789|293.70957598637244|402)\b"),
    ],
    ids=["delta", "arm", "tripod", "ptm"],
)
def test_growth_is_that_of_a_machine_with_longer_parts(name: str, numbers: str) -> None:
    machine = machine_of(text_of(name))
    rows, a = warm(rows_of(machine)), 2e-5
    real = grown(text_of(name), numbers, a * (WARM_C - 20.0))
    found = predicted(rows, effect_named("thermal-growth", machine), np.array([a]))
    truth = moved(rows, forward(machine, rows.extension), forward(real, rows.extension))
    assert np.abs(truth).max() > 0.01
    np.testing.assert_allclose(found, truth, atol=1e-3 * np.abs(truth).max())


@pytest.mark.parametrize("name", ["hexapod", "hexapod-universal", "stewart"])
def test_legs_that_are_driven_grow_as_they_are_extended(name: str) -> None:
    machine = machine_of(text_of(name))
    rows, a = warm(rows_of(machine)), 2e-5
    length = machine.coordinates(rows.extension)
    real = forward(machine, rows.extension + a * (WARM_C - 20.0) * length)
    found = predicted(rows, effect_named("thermal-growth", machine), np.array([a]))
    truth = moved(rows, forward(machine, rows.extension), real)
    np.testing.assert_allclose(found, truth, atol=1e-7)


def with_arms(name: str) -> Machine:
    """The machine with arms L_B, L_P between the axes of its universal joints; zero in the file."""
    text = without_traits(text_of(name))
    for old, new in (
        ("foot=Uxy", "Rx tz:L_B Ry"),
        ("head=Uxy", "Rx tz:L_P Ry"),
        ("hook=Uxy(0,25.7d)", "Rx tz:-L_B Ry(25.7d)"),
        ("psi_B=Rx(90d)", "psi_B=Rx(90d) ty:L_B"),
        ("swing_P=Rz", "swing_P=Rz ty:L_P"),
    ):
        text = text.replace(old, new)
    arms = [arm for arm in ("L_B", "L_P") if f":{arm}" in text or f":-{arm}" in text]
    rows = [f'{arm} = {{ unit = "mm", tolerance = 0.1, nominal = 0.0 }}\n' for arm in arms]
    return machine_of(text.replace(".parameters]\n", ".parameters]\n" + "".join(rows), 1))


@pytest.mark.parametrize("name", ["hexapod-universal", "stewart", "delta"])
def test_offset_is_that_of_a_machine_with_arms(name: str) -> None:
    """Exact for arms of 5 mm. The two rods of a delta's tower get the same arm in the real one."""
    machine, real = machine_of(text_of(name)), with_arms(name)
    rows, effect = rows_of(machine), effect_named("joint-offset", machine)
    generator = np.random.default_rng(3)
    arms = {
        p.name: 5.0 + 0.5 * generator.normal()
        for p in real.parameters
        if p.name not in machine.parameter_index
    }
    assert {n.rpartition(".")[2] for n in arms} == ({"L_B"} if name == "delta" else {"L_B", "L_P"})
    of = [u.name.removeprefix("joint-offset.") for u in effect.unknowns(rows)]
    values = np.array([arms[re.sub(r"\.[12]\.", ".", own)] for own in of])
    found = predicted(rows, effect, values)
    truth = moved(
        rows, forward(machine, rows.extension), forward(real, rows.extension, real.vector(arms))
    )
    assert np.abs(truth).max() > 3.0
    np.testing.assert_allclose(found, truth, atol=1e-5)


def test_tilt_is_that_of_a_machine_with_turned_joints() -> None:
    """A 6-UPS whose joints have arms, its first axes turned before and behind them."""
    arm = {"foot=Uxy": "first=Rx tz:4 second=Ry", "head=Uxy": "third=Rx tz:4 fourth=Ry"}
    text = text_of("stewart")
    for old, new in arm.items():
        text = text.replace(old, new)
    text = text.replace('base_joint = "foot"', 'base_joint = ["first", "second"]')
    text = text.replace('platform_joint = "head"', 'platform_joint = ["fourth", "third"]')
    machine = machine_of(text)
    turned = text.replace("first=Rx", "ry:e_y rz:e_z first=Rx").replace(
        "fourth=Ry", "fourth=Ry rx:-f_x rz:-f_z"
    )
    tilts = ("e_y", "e_z", "f_x", "f_z")
    rows_text = [f'{t} = {{ unit = "rad", tolerance = 1e-3, nominal = 0.0 }}\n' for t in tilts]
    turned = turned.replace(".parameters]\n", ".parameters]\n" + "".join(rows_text), 1)
    real = machine_of(without_traits(turned))
    rows, effect = rows_of(machine), effect_named("joint-tilt", machine)
    letters = {"base.y": "e_y", "base.z": "e_z", "platform.x": "f_x", "platform.z": "f_z"}
    plain = forward(machine, rows.extension)
    names = [u.name.removeprefix("joint-tilt.") for u in effect.unknowns(rows)]
    assert len(names) == 24
    for index in (0, 1, 6, 7, 10, 11):
        limb, _, which = names[index].partition(".")
        values = np.zeros(24)
        values[index] = 1e-3
        changed = real.vector({f"{limb}.{letters[which]}": 1e-3})
        truth = moved(rows, plain, forward(real, rows.extension, changed, None))
        found = predicted(rows, effect, values)
        np.testing.assert_allclose(found, truth, atol=3e-3 * np.abs(truth).max(), err_msg=which)


def test_a_tilt_moves_nothing_where_the_axes_meet() -> None:
    """Why joint-tilt is not asked on a Stewart platform and on the hexapod without offsets."""
    for name, old, new in (
        ("stewart", "foot=Uxy", "ry:0.01 rz:-0.02 foot=Uxy"),
        ("hexapod-universal", "psi_B=Rx", "ry:0.01 rz:-0.02 psi_B=Rx"),
    ):
        machine = machine_of(text_of(name))
        real = machine_of(text_of(name).replace(old, new))
        rows = rows_of(machine)
        truth = moved(rows, forward(machine, rows.extension), forward(real, rows.extension))
        assert np.abs(truth).max() < 1e-8
        assert "axes of its universal joints meet" in not_defined(machine)["joint-tilt"]


def stewart_twist(machine: Machine, position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Angle (6, N) about each leg from base-side to platform-side second axis, from poses alone."""
    twists = []
    for leg in range(1, 7):
        B, P = (
            np.array([machine.nominal[machine.index(f"leg{leg}.{s}_{a}")] for a in "xyz"])
            for s in "BP"
        )
        along = position + np.einsum("ijn,j->in", rotation, P) - B[:, None]
        u = (along / np.linalg.norm(along, axis=0)).T
        first = np.broadcast_to([1.0, 0.0, 0.0], u.shape)
        last = rotation[:, 1].T
        below, above = np.cross(first, u), np.cross(last, -u)
        below = below / np.linalg.norm(below, axis=1)[:, None]
        above = above / np.linalg.norm(above, axis=1)[:, None]
        sine = np.einsum("ni,ni->n", u, np.cross(below, above))
        twists.append(np.arctan2(sine, np.einsum("ni,ni->n", below, above)))
    return np.array(twists)


def test_twist_of_a_stewart_platform_is_that_of_its_axes() -> None:
    machine = machine_of(text_of("stewart"))
    rows, lead = rows_of(machine), 0.5
    home = home_configuration(machine).poses
    plain = forward(machine, rows.extension)
    found = predicted(rows, effect_named("screw-twist", machine), np.array([lead]))
    real = plain
    for _ in range(6):
        twist = stewart_twist(machine, real.poses.position, real.poses.rotation)
        change = twist - stewart_twist(machine, home.position, home.rotation)
        change = (change + np.pi) % (2.0 * np.pi) - np.pi
        real = forward(machine, rows.extension + lead / (2.0 * np.pi) * change)
    truth = moved(rows, plain, real)
    assert np.abs(truth).max() > 0.01
    np.testing.assert_allclose(found, truth, atol=1e-6)


def test_azimuth_of_a_deltas_corner_is_that_of_a_machine_with_it_turned() -> None:
    machine = machine_of(text_of("delta"))
    rows, effect = rows_of(machine), effect_named("joint-azimuth", machine)
    turn = 1e-3
    text = text_of("delta").replace(
        'corner = "120 deg"', f'corner = "{np.rad2deg(turn) + 120} deg"'
    )
    found = predicted(rows, effect, np.array([0.0, turn, 0.0]))
    plain, real = (forward(m, rows.extension) for m in (machine, machine_of(text)))
    truth = moved(rows, plain, real)
    assert np.abs(truth).max() > 0.01
    np.testing.assert_allclose(found, truth, atol=2e-3 * np.abs(truth).max())


def test_sides_of_a_delta_that_is_calibrated_by_one_length_can_be_asked() -> None:
    """With one length for both rods, their difference is what joint lengths cannot say."""
    text = (
        text_of("delta")
        .replace("tz:-length_a", "side_a=tz:-rod")
        .replace("tz:-length_b", "side_b=tz:-rod")
    )
    text = re.sub(r"length_a = (.*)\nlength_b = .*\n", r"rod = \1\n", text)
    text = text.replace('grows = ["length_a", "length_b"]', 'grows = "rod"')
    text = text.replace('["length_a", "length_b"]', '["side_a", "side_b"]')
    machine, both = machine_of(text), machine_of(text_of("delta"))
    rows, effect = rows_of(machine), effect_named("parallelogram-sides", machine)
    found = predicted(rows, effect, np.array([0.0, 0.02, 0.0]))
    changed = both.vector({"tower2.length_a": 300.01, "tower2.length_b": 299.99})
    truth = moved(rows, forward(both, rows.extension), forward(both, rows.extension, changed))
    assert np.abs(truth).max() > 0.01
    np.testing.assert_allclose(found, truth, atol=2e-3 * np.abs(truth).max())
    assert "calibrated already" in not_defined(both)["parallelogram-sides"]
