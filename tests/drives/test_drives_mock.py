"""The bare machine itself: its EDS files, and that no controller is there."""

import json
import subprocess
import sys

from mocks.canopen.bare_eds import shipped_bare_eds


def test_the_eds_files_are_as_their_maker_writes_them():
    for path, text in shipped_bare_eds():
        assert path.read_text(encoding="utf-8") == text, "python -m mocks.canopen.bare_eds"


def test_a_tripod_has_no_drives_that_could_be_alone():
    command = [sys.executable, "-m", "mocks.station", "tripod", "--bare"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2
    assert "--bare" in ended.stderr


def test_a_station_of_drives_alone_says_so_in_its_site():
    command = [sys.executable, "-m", "mocks.station", "ptm", "--bare", "--json"]
    process = subprocess.Popen(
        [*command, "--until-stdin-closes"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        controller = json.loads(process.stdout.readline())["site"]["controller"]
    finally:
        process.stdin.close()
        process.wait(10)
        process.stdout.close()
    assert controller["kind"] == "drives"
    assert len(controller["speed"]) == 2
