"""In a terminal without UTF-8 the screens stand sign for sign in ASCII."""

import re
from pathlib import Path

import pytest
from test_tui_terminal import Terminal

from app.tui.signs import in_ascii, only_ascii
from app.tui.wording import micro

APP = Path(__file__).parents[2] / "app"


@pytest.mark.parametrize(
    ("environment", "ascii_only"),
    [
        ({}, False),
        ({"LANG": "C"}, True),
        ({"LANG": "C", "LC_CTYPE": "C.UTF-8"}, True),  # as Python leaves it
        ({"LANG": "en_US.UTF-8"}, False),
        ({"LANG": "C.UTF-8"}, False),
        ({"LANG": "de_DE.utf8", "LC_ALL": "POSIX"}, True),
        ({"LANG": "C", "LC_ALL": "en_US.UTF-8"}, False),
        ({"LC_CTYPE": "en_US.ISO-8859-1"}, True),
        ({"LANG": "de_DE"}, False),
        ({"TERM": "dumb", "LANG": "en_US.UTF-8"}, True),
    ],
)
def test_the_locale_says_what_the_terminal_has(
    environment: dict[str, str], ascii_only: bool
) -> None:
    assert only_ascii(environment) is ascii_only


def test_every_sign_of_the_screens_has_one_of_its_own_length() -> None:
    sources = [*APP.glob("tui/**/*.py"), *APP.glob("show/*.py"), *APP.glob("tui/*.tcss")]
    signs = set("".join(path.read_text(encoding="utf-8") for path in sources))
    signs |= {chr(code) for code in (*range(0x2500, 0x25A0), *range(0x2800, 0x2900))}
    for sign in signs:
        plain = in_ascii(sign)
        assert len(plain) == 1
        assert plain.isascii()
        assert plain != "?" or sign == "?", sign
    assert in_ascii("╭─ Site ─╮│ 3.1 ± 0.2 µm ✓") == "+- Site -+| 3.1 ~ 0.2 um +"
    assert in_ascii("⠀⣿") == " #"


@pytest.mark.long
def test_nothing_but_ascii_is_sent_where_there_is_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LC_ALL", "C")
    terminal = Terminal(tmp_path)
    try:
        terminal.until_it_says("No site is open")
        terminal.until_it_says("+- Site ---")
        assert terminal.said.isascii()
        assert re.search("STOP", terminal.said)
    finally:
        terminal.end()


def test_micrometres_have_one_sign_on_the_screens_and_paths_keep_their_letters() -> None:
    assert micro("RMS 5.1 um (limit 50 um): 12 um.") == "RMS 5.1 µm (limit 50 µm): 12 µm."
    for name in ("runs/um/run", "um.toml", "album", "um-2"):
        assert micro(f"in {name}") == f"in {name}"
    assert in_ascii(micro("7 um")) == "7 um"
    assert micro("over 4.1 +- 1.2 min, +-5 V") == "over 4.1 ± 1.2 min, +-5 V"
