"""The tripod through the wires: measure, fit, apply, verify, undo, as on the hexapod."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from app.files.site import parse_site
from calib.errors import BadInput
from mocks.gcs.tripod_kinematics import position_of
from mocks.physics.truth import machine_file, nominal_parameters
from tests.answers import faults_of

SCALE = 300
NOMINAL = nominal_parameters(machine_file("tripod"))


@dataclass
class Lab:
    """A mock station and a folder to work in."""

    announcement: dict[str, Any]
    folder: Path

    def pkmcal(self, *words: str, code: int = 0) -> dict[str, Any]:
        """Run a verb and return its answer."""
        done = subprocess.run(
            [sys.executable, "-c", "from app.cli import main; main()", *words, "--json"],
            cwd=self.folder,
            env={**os.environ, "PKMCAL_STATE": str(self.folder / "state")},
            capture_output=True,
            text=True,
            timeout=100,
        )
        assert done.returncode == code, done.stderr
        found: dict[str, Any] = json.loads(done.stdout)
        assert faults_of(found) == []
        return found

    def site(self, port: str) -> str:
        """A site file with this port."""
        text = (self.folder / "site.toml").read_text(encoding="utf-8")
        own = parse_site(text, "site.toml", self.folder).controller.address
        path = self.folder / f"site-{len(port)}.toml"
        path.write_text(text.replace(f'"{own}"', f'"{port}"'), encoding="utf-8")
        return path.name


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    command = [sys.executable, "-m", "mocks.station", "tripod", "--json", "--until-stdin-closes"]
    options = ["--seed", "5", "--scale", str(SCALE), "--smrs", "3"]
    files = ["--nvm", str(tmp_path / "nvm.json"), "--site", str(tmp_path / "site.toml")]
    process = subprocess.Popen(
        [*command, *options, *files], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        yield Lab(json.loads(process.stdout.readline()), tmp_path)
    finally:
        process.communicate(timeout=10)


def stored(lab: Lab) -> dict[str, float]:
    memory = json.loads((lab.folder / "nvm.json").read_text(encoding="utf-8"))
    return {name: float.fromhex(value) for name, value in memory["values"].items()}


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_whole_job_on_serial_line_and_tcp(lab: Lab) -> None:
    tcp = lab.site(lab.announcement["gcs"])
    serial = lab.site(lab.announcement["serial_port"] or lab.announcement["gcs"])
    (lab.folder / "poses.toml").write_text(POSES, encoding="utf-8")
    run = lab.pkmcal("measure", "--site", serial, "--poses", "poses.toml", "--unattended")
    fit = lab.pkmcal("fit", run["run"], "--save", "fit.json")
    assert all(parameter["identified"] for parameter in fit["parameters"][:9])

    applied = lab.pkmcal("apply", "fit.json", "--site", tcp, "--yes", "--unattended")
    assert applied["check_before"]["position_peak_um"] > 300.0
    assert applied["check_after"]["position_peak_um"] < 40.0
    fitted = {p["name"]: p["value"] for p in fit["parameters"] if p["name"].startswith("limb")}
    assert stored(lab) == pytest.approx(fitted, abs=1e-12)

    verified = lab.pkmcal("verify", "--site", serial, "--poses", "poses.toml", "--unattended")
    assert verified["measured"]["position_peak_um"] < 40.0

    lab.pkmcal("undo", "--site", tcp, "--to", "1")
    assert stored(lab)["limb1.l0"] == 410.0
    assert stored(lab)["limb1.h"] == 260.0


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('kind = "gcs"', 'kind = "gsc"', "gsc"),
        ('port = "COM3"', "", "port"),
        ('port = "COM3"', 'port = "COM3"\naxes = "A B"', "2 words, 3 are wanted"),
        ('port = "COM3"', 'port = "COM3"\nbaudrate = 1', "baudrate"),
        ('port = "COM3"', 'port = "COM3"\nchannel = "can0"', "channel"),
    ],
)
def test_site_file_with_a_fault(tmp_path: Path, old: str, new: str, says: str) -> None:
    assert parse_site(SITE, "site.toml", tmp_path).controller.address == "COM3"
    with pytest.raises(BadInput, match=says):
        parse_site(SITE.replace(old, new), "site.toml", tmp_path)


# Sliders between 300 and 415: 15 mm from the ends of their strokes, whatever the true parameters.
PLACES = [q for q in product((300.0, 360.0, 415.0), repeat=3) if q.count(360.0) != 1][::2]
POSES = """format = "pkm-poses/1"
machine = "tripod"

[poses]
""" + "\n".join(
    "p{} = {{ x = {:.3f}, y = {:.3f}, z = {:.3f} }}".format(n, *position_of(q, NOMINAL))
    for n, q in enumerate(PLACES, start=1)
)
SITE = """format = "pkm-site/1"
machine = "tripod"

[controller]
kind = "gcs"
port = "COM3"

[tracker]
kind = "emscon"
address = "127.0.0.1:9"
frame = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]

[nests.platform]
p1 = [120.0, 0.0, -60.0]

[nests.base]
b1 = [240.0, 415.0, -40.0]
b2 = [-480.0, 0.0, -40.0]
b3 = [240.0, -415.0, -40.0]
"""
