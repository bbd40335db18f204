"""Settings of devices in the site file, as their kinds declare them."""

from pathlib import Path

import pytest

from app.devices import all_kinds, kind_named
from app.files.device_settings import read_settings
from calib.errors import BadInput
from calib.toml_table import TomlTable
from drivers.kind import Kind, Setting

TRACKER_KEYS = {"kind", "serial", "model", "reflector", "frame", "frame_radius_mm"}


async def _nothing(_: object) -> None:
    raise AssertionError


KIND: Kind = Kind(
    "a device",
    (
        Setting("channel", "text", "its channel"),
        Setting("mode", "text", "how", "fast", choices=("fast", "slow")),
        Setting("node", "whole", "its node", 10, least=1, most=127),
        Setting("wait_s", "number", "patience", 1.0, least=0.1, most=9.0),
        Setting("air", "numbers", "deg C, hPa, %", None, count=3),
        Setting("axes", "words", "its axes", ["A", "B"], count="actuators"),
        Setting("host", "address", "where", "here:1", port=700),
        Setting("file", "file", "its file", ""),
        Setting("more", "table", "anything", {}),
        Setting("even", "whole", "an even number", 2, check=lambda n: "" if n % 2 == 0 else "odd"),
    ),
    _nothing,
    lambda settings: settings["channel"],
)


def read(text: str) -> dict:
    return read_settings(TomlTable.parse(text, "site.toml"), KIND, 2, Path("/lab"))


def test_defaults_and_forms() -> None:
    found = read(
        'channel = "can0"\nair = [20, 1013, 50]\naxes = "X Y"\nhost = "tracker"\nfile = "a.eds"\n'
        "[more]\nhop_limit = 0\n"
    )
    assert found == {
        "channel": "can0",
        "mode": "fast",
        "node": 10,
        "wait_s": 1.0,
        "air": (20.0, 1013.0, 50.0),
        "axes": ["X", "Y"],
        "host": "tracker:700",
        "file": str(Path("/lab/a.eds").resolve()),
        "more": {"hop_limit": 0},
        "even": 2,
    }


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("", "channel is missing"),
        ("node = 200", "node"),
        ("node = 0", "node"),
        ("wait_s = 0.0", "wait_s"),
        ('wait_s = "long"', "wait_s"),
        ('mode = "fsat"', "mode"),
        ("air = [20, 1013]", "air"),
        ('axes = "X Y Z"', "3 words, 2 are wanted"),
        ('host = "a:b"', "host"),
        ("more = 3", "more"),
        ("even = 3", "odd"),
    ],
)
def test_faults_are_named_with_their_line(line: str, says: str) -> None:
    text = f'channel = "can0"\n{line}\n' if line else "node = 3\n"
    with pytest.raises(BadInput, match=says) as caught:
        read(text)
    assert "site.toml, line" in caught.value.place


def test_an_unknown_interface_is_known_before_anything_is_opened() -> None:
    kind = kind_named("controller", "canopen")
    table = TomlTable.parse('interface = "slkan"\nchannel = "can0"\n', "site.toml")
    with pytest.raises(BadInput, match="no interface 'slkan'") as caught:
        read_settings(table, kind, 6, Path())
    assert "line 1" in caught.value.place


@pytest.mark.parametrize(("role", "name", "kind"), list(all_kinds()), ids=lambda one: str(one)[:12])
def test_every_kind_says_what_it_needs(role: str, name: str, kind: Kind) -> None:
    assert kind.says
    names = [setting.name for setting in kind.settings]
    assert len(set(names)) == len(names)
    assert all(setting.says for setting in kind.settings)
    if name != "operator":  # a person is here
        assert any(setting.required for setting in kind.settings)  # where the device is
    taken = {"kind", "serial", "store"} if role == "controller" else TRACKER_KEYS
    assert not taken & set(names), "the site file has another meaning for it"
