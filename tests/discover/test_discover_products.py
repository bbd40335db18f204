"""Formulas that nobody named: products of two states with their units, and what they are worth."""

import pytest

import pkmcal
from calib.discover.products import actuator_products, point_products, unit_of
from calib.formulas.effect_file import effect_from_text

CHANNELS = [("air_temp_C", "(air_temp_C - 20)"), ("payload_kg", "(payload_kg - 6)")]


def test_a_coefficient_has_the_unit_that_makes_its_term_a_length():
    assert unit_of("mm", (("mm", 1),)) == "1"
    assert unit_of("mm", (("mm", 1),), (("mm", 1),)) == "1/mm"
    assert unit_of("mm", (("N", 1),), (("K", 1),)) == "mm/(N K)"
    assert unit_of("rad", (("N", 1), ("mm", 1)), (("s", 2),)) == "rad/(N mm s^2)"
    assert unit_of("mm") == "mm"


@pytest.mark.parametrize("unit", ["mm", "rad"])
def test_every_product_is_an_effect_of_its_own(unit):
    products = list(actuator_products(unit, CHANNELS, timed=True))
    texts = [one.text for one in products]
    assert len(set(texts)) == len(texts)
    for one in [*products, *point_products(CHANNELS)]:
        own = one.text if "{a}" in one.text else f"{{a}} * {one.text}"
        effect_from_text(
            f'[effect]\nid = "x"\nexpression = "{own.format(a="a")}"\n'
            f'unknowns = {{ a = "{one.unit}" }}\n',
            "x",
        )


@pytest.mark.long
def test_an_effect_of_no_catalogue_is_proposed_and_helps_poses_not_seen(tmp_path):
    run, file = tmp_path / "run", tmp_path / "found.toml"
    pkmcal.simulate(
        "hexapod", run, poses=50, noise_um=4.0, seed=5, payload=(0.0, 12.0, 0.0, 12.0),
        effects={"unknown.soft-legs.k": 3e-6},
    )  # fmt: skip
    (term,) = pkmcal.compare(run, propose=file).proposed
    assert term.formula == "a * s * force"
    assert term.held_out_um < 0.97 * term.held_out_before_um
    assert "um without" in file.read_text()
    found = {one.name: one for one in pkmcal.fit(run, add=[str(file)]).parameters}["found-1.a"]
    assert abs(found.value - 3e-6) < 4.0 * found.sigma
