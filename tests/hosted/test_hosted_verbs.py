"""The verbs on machines that hold no parameters: a whole job, and what can happen to the store."""

import asyncio
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.cli import run
from app.demo.station import mock_station
from app.files.machines import load_machine
from app.files.site import load_site
from app.hosted.store import HostStore, usual_folder
from app.session.links import open_controller
from calib.poses import verification_poses
from drivers.interface import Identity

MACHINE = load_machine("hexapod")
GRID = verification_poses(MACHINE).by_label
KINDS = ("--bare", "--pose")

pytestmark = pytest.mark.long


@pytest.fixture(params=KINDS)
def station(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path]:
    with mock_station("hexapod", 5, 300.0, tmp_path, [request.param]) as site:
        text = site.read_text(encoding="utf-8")  # a busy computer starves the mock for a second
        patient = text.replace("[controller]\n", "[controller]\nsilence_s = 10.0\n")
        site.write_text(patient, encoding="utf-8")
        yield site


class Verbs:
    """Verbs of the program in this process, in a folder of their own."""

    def __init__(self, site: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self._site, self._capsys = site, capsys
        self.folder = site.parent

    def __call__(self, *words: str, code: int = 0, on: bool = True) -> str:
        """What a verb prints on both streams; it must end with this code."""
        more = ["--site", str(self._site)] if on else []
        found = run([*words, *more])
        said = self._capsys.readouterr()
        assert found == code, said.err
        return said.out + said.err

    def poses(self, name: str, labels: list[str]) -> str:
        rows = [f"{k},{','.join(map(repr, GRID[k]))}" for k in labels]
        path = self.folder / name
        path.write_text("\n".join(["pose,x,y,z,rx,ry,rz", *rows]) + "\n", encoding="utf-8")
        return str(path)

    def verified(self, poses: str) -> float:
        """Peak position error as the tracker sees it, um."""
        words = ["verify", "--poses", poses, "--unattended", "--json"]
        said = self(*words, "--folder", str(self.folder / "sessions"))
        return float(json.loads(said[: said.rindex("}") + 1])["measured"]["position_peak_um"])


@pytest.fixture
def verbs(station: Path, capsys: pytest.CaptureFixture[str]) -> Verbs:
    return Verbs(station, capsys)


def store_of(site_file: Path) -> HostStore:
    site = load_site(site_file)
    return HostStore(
        usual_folder(site.machine, Identity("", serial=site.controller.serial)), site.machine
    )


def test_verify_measure_fit_apply_verify_undo(verbs: Verbs, station: Path) -> None:
    labels = list(np.random.default_rng(2).permutation(list(GRID)))
    check = verbs.poses("check.csv", labels[:3])
    before = verbs.verified(check)
    sessions = str(verbs.folder / "sessions")
    words = ["measure", "--poses", verbs.poses("poses.csv", labels[6:24])]
    verbs(*words, "--no-warm-up", "--unattended", "--folder", sessions)
    (measured,) = Path(sessions).glob("*-measure/run")
    header = (measured / "run.toml").read_text(encoding="utf-8")
    assert "[controller.parameters]" not in header
    model = str(verbs.folder / "model.toml")
    verbs("fit", str(measured), "--save", model, on=False)
    said = verbs("apply", model, "--yes", "--unattended", "--folder", sessions)
    assert "kept as set 2; the way back: pkmcal undo --to 1" in said
    after = verbs.verified(check)
    assert after < 0.2 * before

    store = store_of(station)
    path = store.path(store.numbers()[-1])
    path.write_text(path.read_text(encoding="utf-8").replace("230.", "231.", 1), encoding="utf-8")
    said = verbs("verify", "--poses", check, "--unattended", "--folder", sessions, code=3)
    assert f"{path.name} cannot be used: its checksum" in said
    assert "pkmcal undo --to" in said
    assert "in the controller" in verbs("undo", "--list")
    verbs("undo", "--to", "2")
    assert verbs.verified(check) < 0.2 * before
    verbs("undo")
    assert verbs.verified(check) == pytest.approx(before, rel=0.2)


HOLDS = """
import asyncio, sys
from pathlib import Path
from app.files.site import load_site
from app.session.links import open_controller

async def main():
    controller = await open_controller(load_site(Path(sys.argv[1])))
    await controller.write_parameters({"leg1.L0": 240.0})
    print("written", flush=True)
    await asyncio.sleep(60)

asyncio.run(main())
"""


def test_a_process_killed_between_write_and_store_leaves_the_stored_set(station: Path) -> None:
    words = [sys.executable, "-c", HOLDS, str(station)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "written\n"
        other.send_signal(signal.SIGKILL)
        other.wait(20)

    async def held() -> dict[str, float]:
        controller = await open_controller(load_site(station))
        try:
            return await controller.read_parameters()
        finally:
            await controller.close()

    assert asyncio.run(held()) == {p.name: p.nominal for p in MACHINE.parameters}


def test_a_store_that_another_owns_is_refused(verbs: Verbs, station: Path) -> None:
    store = store_of(station)
    store.open()
    try:
        said = verbs("undo", "--list", code=5)
    finally:
        store.close()
    assert f"the host store {store.folder} is in use by process" in said
