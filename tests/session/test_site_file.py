"""Site files: what is wrong is named with its line and a remedy; a good one goes round."""

import asyncio
from pathlib import Path

import pytest
from session_mock import site_text

from app.files.site import parse_site
from app.session.links import open_controller
from calib.errors import BadInput


def test_a_good_site_goes_round(tmp_path: Path) -> None:
    site = parse_site(site_text(), "site.toml", tmp_path)
    again = parse_site(site.to_toml(), "again", tmp_path)
    assert again.platform_nests == site.platform_nests
    assert again.tracker == site.tracker
    assert again.limits == site.limits
    assert site.machine.name == "hexapod"


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [
        ("pkm-site/1", "pkm-site/9", 1, "format"),
        ('"hexapod"', '"hexapot"', None, "unknown machine"),
        ('channel = "socket://127.0.0.1:9"\n', "", 4, "channel"),
        ('"emscon"', '"leica"', 9, "emscon"),
        ("127.0.0.1:9\"\nframe", "127.0.0.1:port\"\nframe", 10, "host:port"),
        ("0.0, 0.0, 0.3]", "0.0, 0.3]", 11, "6 finite numbers"),
        ("[260.0, 0.0, -30.0]", "[260.0, nan, -30.0]", 19, "3 finite numbers"),
        ('kind = "operator"', 'kind = "operator"\nsmr = 1', 26, "smr"),
        ("smrs = 1", "smrs = 0", 26, "smrs"),
        ("b1 =", '"3" =', 19, "both"),
        ("smrs = 1", 'smrs = 1\n\n[limits]\ndwell = 3.0', 29, "dwell"),
        ("smrs = 1", 'smrs = 1\n\n[limits]\ndwell_s = 0', 29, "greater than 0"),
        ("smrs = 1", 'smrs = 1\n\n[limits]\nair_temp_C = [35, 10]', 29, "lower limit first"),
        ('kind = "canopen"', 'kind = "canopen"\nnode = 200', 6, "at most 127"),
        ('kind = "canopen"', 'kind = "canopen"\ninterface = "slkan"', 6, "mean 'slcan'"),
        ("smrs = 1", 'smrs = 1\n\n[clock]\nscale = 0', 29, "greater than 0"),
        ("smrs = 1", "smrs = = 1", 26, "TOML"),
    ],
)  # fmt: skip
def test_a_fault_is_named_with_its_line(
    tmp_path: Path, old: str, new: str, line: int | None, what: str
) -> None:
    text = site_text()
    assert old in text
    with pytest.raises(BadInput) as wrong:
        parse_site(text.replace(old, new, 1), "site.toml", tmp_path)
    assert what in str(wrong.value)
    if line is not None:
        assert f"{wrong.value.place},".startswith(f"site.toml, line {line},")


def test_a_lab_with_two_base_nests_is_told_why_that_is_too_few(tmp_path: Path) -> None:
    text = site_text().replace("b3 = [-260.0, 0.0, -30.0]\nb4 = [0.0, -260.0, -30.0]\n", "")
    with pytest.raises(BadInput, match="three tie tracker and base"):
        parse_site(text, "site.toml", tmp_path)


def test_every_path_of_a_site_holds_from_the_folder_of_a_session(tmp_path: Path) -> None:
    six = "[3.0, 3.0, 3.0, 3.0, 3.0, 3.0]"
    drives = f'kind = "drives"\neds = "a.eds"\nstore = "s"\nspeed = {six}\nacceleration = {six}'
    text = site_text().replace('kind = "canopen"', f"{drives}\nhoming_method = {six}")
    site = parse_site(text, "site.toml", tmp_path)
    copied = parse_site(site.to_toml(), "copy", tmp_path / "elsewhere")
    assert copied.controller == site.controller
    assert copied.controller.store == str(tmp_path / "s")
    assert str(tmp_path / "a.eds") in str(copied.controller.settings["eds"])
    with pytest.raises(BadInput, match=rf"no file {tmp_path}/a.eds") as refused:
        asyncio.run(open_controller(site))
    assert "[controller] eds" in str(refused.value)


EFFECT = """
[effect]
id = "cable"
says = "a cable pulls where a leg is long"
acts_on = "actuator"
expression = "k * s**2 * direction"
unknowns = { k = "1/mm" }
"""


def test_a_site_offers_effects_that_are_read_before_anything_is_measured(tmp_path: Path) -> None:
    file = tmp_path / "cable.toml"
    file.write_text(EFFECT, encoding="utf-8")
    offering = f'{site_text()}\n[effects]\noffer = ["cable.toml"]\n'
    site = parse_site(offering, "site.toml", tmp_path)
    assert site.offers == (file.resolve(),)
    assert parse_site(site.to_toml(), "copy", tmp_path / "elsewhere").offers == site.offers
    file.write_text(EFFECT.replace("s**2", "s**"), encoding="utf-8")
    with pytest.raises(BadInput, match="column"):
        parse_site(offering, "site.toml", tmp_path)


def test_the_record_names_a_wrong_day_and_a_missing_logo(tmp_path: Path) -> None:
    text = site_text() + '\n[record]\ncustomer = "C"\n'
    assert parse_site(text, "site.toml", tmp_path).record.customer == "C"
    for wrong, said in (
        ('tracker_calibrated = "14.3.2026"', "no day"),
        ('logo = "l.svg"', "no file"),
    ):
        with pytest.raises(BadInput, match=said) as fault:
            parse_site(text + wrong, "site.toml", tmp_path)
        assert wrong.split()[0] in fault.value.place


def test_paths_of_the_record_hold_from_everywhere(tmp_path: Path) -> None:
    (tmp_path / "l.svg").write_text("<svg/>")
    site = parse_site(site_text() + '\n[record]\nlogo = "l.svg"\n', "site.toml", tmp_path)
    again = parse_site(site.to_toml(), "copy", tmp_path / "elsewhere")
    assert again.record.logo == str((tmp_path / "l.svg").resolve())
