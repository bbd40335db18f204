"""Every fault of a site or poses file is named at once, each once, and by its line."""

from itertools import combinations
from pathlib import Path

import pytest

from app.files.machines import load_machine
from app.files.poses import parse_pose_file
from app.files.site import parse_site
from app.tui.wording import said
from calib.errors import BadInput
from calib.toml_faults import ManyFaults
from calib.toml_table import TomlTable

SITE = """format = "pkm-site/1"
title = "a lab"
machine = "hexapod"
[controller]
kind = "canopen"
channel = "socket://127.0.0.1:9"
node = 7
[tracker]
kind = "emscon"
address = "127.0.0.1:9"
frame = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
[nests.platform]
"3" = [0.0, 100.0, 0.0]
[nests.base]
b1 = [240.0, 415.0, -40.0]
b2 = [-480.0, 0.0, -40.0]
b3 = [0.0, -480.0, -40.0]
[hands]
kind = "operator"
smrs = 1
[limits]
dwell_s = 3.0
air_temp_C = [10.0, 35.0]
[record]
tolerance_um = 40.0
[load]
payload_kg = 1.0
"""
SPOILT = {
    2: "title = 5",
    3: 'machine = "hexapot"',
    5: 'kind = "canoe"',
    7: "node = 200",
    10: 'address = "127.0.0.1:port"',
    11: "frame = [0.0, 0.3]",
    13: '"3" = [0.0, nan, 0.0]',
    16: "b2 = 7",
    19: 'kind = "robot"',
    20: "smrs = 0",
    22: "dwell = 3.0",
    23: "air_temp_C = [35.0, 10.0]",
    25: "tolerance_um = -40.0",
    27: 'payload_kg = "heavy"',
}
HIDES = {5: {7}}
"""What cannot be told while another line is wrong: settings of a kind that is not known."""


def lines_of(refused: BadInput) -> list[int]:
    faults = refused.faults if isinstance(refused, ManyFaults) else (refused,)
    return [int(str(one.place).partition("line ")[2].partition(",")[0]) for one in faults]


def spoilt(wrong: tuple[int, ...]) -> str:
    lines = SITE.splitlines()
    for line in wrong:
        lines[line - 1] = SPOILT[line]
    return "\n".join(lines)


def test_the_site_as_it_is_is_read(tmp_path: Path) -> None:
    assert parse_site(SITE, "site.toml", tmp_path).hands.smrs == 1


@pytest.mark.parametrize(
    "wrong", [*((line,) for line in SPOILT), *list(combinations(SPOILT, 2))[::6], tuple(SPOILT)]
)
def test_each_fault_is_named_once_by_its_line(tmp_path: Path, wrong: tuple[int, ...]) -> None:
    with pytest.raises(BadInput) as refused:
        parse_site(spoilt(wrong), "site.toml", tmp_path)
    hidden = set().union(*(HIDES.get(line, set()) for line in wrong))
    assert lines_of(refused.value) == sorted(set(wrong) - hidden)
    assert refused.value.place.startswith("site.toml")


def test_a_missing_table_is_one_fault(tmp_path: Path) -> None:
    text = SITE.replace("[tracker]", "[trakcer]").replace("[nests.base]", "[nests.bas]")
    with pytest.raises(ManyFaults) as refused:
        parse_site(text, "site.toml", tmp_path)
    told = str(refused.value)
    assert told.count("tracker is missing") == told.count('unknown key "trakcer"') == 1
    assert "tracker.kind" not in told
    what, remedy = said(refused.value)
    assert what.startswith("site.toml: ")
    assert "\n" not in what + remedy  # the banner and the log are lines


def test_every_pose_that_cannot_be_read_is_named_then_every_one_out_of_reach() -> None:
    head = 'format = "pkm-poses/1"\n[poses]\n'
    good = "p{} = {{ x = {}, y = 0.0, z = 220.0, rx = 0.0, ry = 0.0, rz = 0.0 }}\n"
    machine = load_machine("hexapod")
    for first, last in (('"far"', "true"), (900.0, -900.0)):
        text = head + good.format(1, first) + good.format(2, 0.0) + good.format(3, last)
        with pytest.raises(ManyFaults) as refused:
            parse_pose_file(text, "poses.toml", machine)
        assert lines_of(refused.value) == [3, 5]
    assert "out of reach" in str(refused.value)


def test_who_reads_one_fault_at_a_time_reads_as_before() -> None:
    with pytest.raises(BadInput, match="line 1, a"):
        TomlTable.parse("a = 1\nb = 2", "some.toml").text("a")
    table = TomlTable.parse("a = 1\nb = 2", "some.toml", all_faults=True)
    assert table.text("a", "default") == "default"
    assert table.number("b") == 2.0
    assert table.faults is not None
    with pytest.raises(BadInput, match="line 1, a"):
        table.faults.end()
