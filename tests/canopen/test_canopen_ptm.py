"""The tracking mechanism through the wires: two rotary drives, 83 parameters, the whole job."""

import json
import os
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.canopen import CanopenController
from drivers.errors import Refused
from mocks.control import ControlClient
from mocks.physics.ptm_body import PtmBody
from mocks.physics.truth import draw_parameters
from tests.answers import faults_of

SCALE = 300
BODY = PtmBody()
PLACES = [(tilt, azimuth) for azimuth in range(0, 360, 60) for tilt in (8, 30, 55)]
ELSEWHERE = [(20 + 5 * n, 25 + 47 * n) for n in range(4)]


def poses_file(places: list[tuple[int, int]]) -> str:
    """The text of a poses file; tilt and azimuth in degrees."""
    lines = [
        f'p{n} = {{ tilt = "{t} deg", azimuth = "{f} deg" }}'
        for n, (t, f) in enumerate(places, start=1)
    ]
    return "\n".join(['format = "pkm-poses/1"', 'machine = "ptm"', "[poses]", *lines])


@dataclass
class Lab:
    """A mock station and a folder to work in."""

    announcement: dict[str, Any]
    folder: Path

    def pkmcal(self, *words: str) -> dict[str, Any]:
        """Run a verb and return its answer."""
        done = subprocess.run(
            [sys.executable, "-c", "from app.cli import main; main()", *words, "--json"],
            cwd=self.folder,
            env={**os.environ, "PKMCAL_STATE": str(self.folder / "state")},
            capture_output=True,
            text=True,
            timeout=100,
        )
        assert done.returncode == 0, done.stderr
        found: dict[str, Any] = json.loads(done.stdout)
        assert faults_of(found) == []
        return found


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    command = [sys.executable, "-m", "mocks.station", "ptm", "--json", "--until-stdin-closes"]
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


@pytest.fixture
async def drive(lab: Lab) -> AsyncIterator[CanopenController]:
    limits = {a.name: a.limits for a in BODY.machine.actuators}
    channel = lab.announcement["can"]
    controller = await CanopenController.connect("slcan", channel, machine="ptm", limits=limits)
    try:
        await controller.enable()
        yield controller
    finally:
        await controller.close()


async def test_drives_point_where_the_controller_s_parameters_say(
    lab: Lab, drive: CanopenController
) -> None:
    pose = (radians(35.0), radians(110.0))
    targets = await drive.move_to_pose(pose)
    await drive.wait_arrived(30.0)
    assert targets == pytest.approx(BODY.commanded({}, np.array([pose]))[0], abs=1e-12)
    with ControlClient(lab.announcement["control"]) as hands:
        truth = hands("truth", settled=True)
    # The drives count in nanoradians; the machine points within its tolerances.
    assert truth["extension"] == pytest.approx(targets, abs=1e-9)
    axis = np.array(truth["rotation"])[:, 2]
    assert np.arccos(axis[2]) == pytest.approx(pose[0], abs=0.01)
    assert np.arctan2(axis[1], axis[0]) == pytest.approx(pose[1], abs=0.01)


async def test_written_errors_are_in_use_at_once(drive: CanopenController) -> None:
    held = draw_parameters(BODY.machine, 8, "normal")
    await drive.disable()
    await drive.write_parameters(held)
    found = await drive.read_parameters()
    assert {name: found[name] for name in held} == held
    await drive.enable()
    pose = (radians(20.0), radians(250.0))
    targets = await drive.move_to_pose(pose)
    assert targets == pytest.approx(BODY.commanded(held, np.array([pose]))[0], abs=1e-9)
    assert np.abs(np.array(targets) - BODY.commanded({}, np.array([pose]))[0]).max() > 1e-5


async def test_directions_out_of_reach_are_refused(drive: CanopenController) -> None:
    with pytest.raises(Refused):
        await drive.move_to_pose((radians(110.0), 0.0))
    with pytest.raises(Refused, match="2 finite numbers"):
        await drive.move_to_pose((0.1, 0.2, 0.3))


async def test_a_motor_is_jogged_and_homed_alone(lab: Lab, drive: CanopenController) -> None:
    await drive.jog("q2", 0.2)
    state = await drive.state()
    assert [a.position for a in state.actuators] == pytest.approx([0.0, 0.2], abs=1e-9)
    await drive.home("q2")
    state = await drive.state()
    assert state.actuators[1].position == pytest.approx(0.0, abs=1e-9)


@pytest.mark.long
@pytest.mark.timeout(300)
def test_the_whole_job(lab: Lab) -> None:
    site = ("--site", "site.toml", "--unattended")
    (lab.folder / "poses.toml").write_text(poses_file(PLACES), encoding="utf-8")
    (lab.folder / "elsewhere.toml").write_text(poses_file(ELSEWHERE), encoding="utf-8")
    verify = ("verify", *site, "--poses", "elsewhere.toml", "--truth")
    run = lab.pkmcal("measure", *site, "--poses", "poses.toml", "--no-warm-up")
    fit = lab.pkmcal("fit", run["run"], "--save", "fit.json")
    assert 0.4 < fit["chi2_per_dof"] < 1.8  # noise of a live mock, another one at each run
    before = lab.pkmcal(*verify)
    assert before["truth"]["position_peak_um"] > 200.0
    lab.pkmcal("apply", "fit.json", *site, "--yes")
    after = lab.pkmcal(*verify)
    assert after["truth"]["position_peak_um"] < 0.1 * before["truth"]["position_peak_um"]
    assert after["truth"]["orientation_peak_deg"] < 0.1 * before["truth"]["orientation_peak_deg"]
