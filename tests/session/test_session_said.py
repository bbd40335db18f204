"""What files and devices say commands no terminal, and a browser commands no mock."""

import json
import socket

import pytest

from app.cli import run
from app.plain_data import printable
from app.session.events import AlarmRaised
from drivers.interface import Alarm

NASTY = "\x1b]0;mine\x07\x1b[2J\x9b31m\u202eevil\r"


def test_controls_are_written_out() -> None:
    assert (
        printable(f"a\n\tb{NASTY}c") == "a\n\tb\\x1b]0;mine\\x07\\x1b[2J\\x9b31m\\x202eevil\\x0dc"
    )
    assert printable("µm, Ü, 東京, 1 ± 2") == "µm, Ü, 東京, 1 ± 2"


@pytest.mark.parametrize("verb", [["fit", f"run{NASTY}"], ["machine", "check", f"m{NASTY}.toml"]])
def test_names_of_files_reach_no_terminal_as_they_stand(verb: list[str], capfd) -> None:
    assert run(verb) == 2
    written = capfd.readouterr()
    assert not set(written.out + written.err) & set("\x1b\x9b\x07\u202e\r")
    assert "\\x1b" in written.err


def test_text_of_a_file_reaches_no_terminal(tmp_path, capfd) -> None:
    path = tmp_path / "site.toml"
    escaped = "\\u001b[2J\\u202e"
    path.write_text(f'format = "pkm-site/1"\nmachine = "{escaped}"\n', encoding="utf-8")
    assert run(["site", "check", str(path)]) == 2
    assert not set(capfd.readouterr().err) & set("\x1b\u202e")


def test_an_alarm_of_a_device_reaches_no_terminal(capfd) -> None:
    from app.console import ConsoleFace

    face = ConsoleFace(lambda prompt, choice: None, 3, quiet=False)
    face.hear(AlarmRaised(Alarm("drive", f"says {NASTY}[bold]x[/]", "", fault=True), 1.0))
    written = capfd.readouterr().err
    assert "[bold]x[/]" in written
    assert not set(written) & set("\x1b\x9b\x07\u202e")


def test_a_browser_s_page_carries_no_smr(mock_of) -> None:
    mock = mock_of("--smrs", "1")
    host, _, port = mock.process.announcement["control"].rpartition(":")
    body = json.dumps({"do": "carry", "nest": "3"}).encode()
    before = mock.hands("where")["places"]
    for head in (b"POST / HTTP/1.1\r\nHost: evil\r\n\r\n", b"Host: x\r\n\r\n"):
        with socket.create_connection((host, int(port)), timeout=5.0) as browser:
            browser.sendall(head + body + b"\n")
            assert _all(browser) == b""
    assert mock.hands("where")["places"] == before


def _all(connection: socket.socket) -> bytes:
    """Everything until it is closed, by a reset if some of what was sent was not read."""
    try:
        return connection.makefile("rb").read()
    except ConnectionResetError:
        return b""
