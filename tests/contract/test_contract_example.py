"""The driver package in ``examples/``: installed, found by its entry point, held to the laws."""

import contextlib
import json
import shutil
import subprocess
import sys
from collections.abc import AsyncIterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from contract_bench import LONGEST_S, SCALE

from app.again import command_of
from drivers.contract import TRACKER_LAWS, Law, TrackerBench, why_not
from drivers.interface import Tracker
from drivers.kind import Kind, Surroundings
from mocks.clock import ScaledClock
from mocks.tracker.lines import LineServer
from mocks.world import World, WorldPlan

POSES = "pose,x,y,z,rx,ry,rz\n1,4,-3,221,0.02,-0.03,0\n2,-5,2,216,-0.02,0,0.04\n"
PACKAGE = Path(__file__).parents[2] / "examples" / "line_tracker"


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which pip has installed the package, with its metadata."""
    folder = tmp_path_factory.mktemp("installed")
    source = shutil.copytree(PACKAGE, tmp_path_factory.mktemp("source") / "line_tracker")
    words = ["install", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-index"]
    words += ["--no-build-isolation", "--target", str(folder), str(source)]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True, timeout=100)
    return folder


@pytest.fixture
def kind(installed: Path, monkeypatch: pytest.MonkeyPatch) -> Kind[Tracker]:
    monkeypatch.syspath_prepend(str(installed))
    found: Kind[Tracker] = import_module("line_tracker").KIND
    return found


@contextlib.asynccontextmanager
async def line_bench(kind: Kind[Tracker]) -> AsyncIterator[TrackerBench]:
    clock = ScaledClock(SCALE)
    world = World(clock, WorldPlan(seed=4, smrs=3))
    server = LineServer(world, clock)
    await server.start()
    settings = {"address": server.address, "sigma_mm": 0.005, "silence_s": 1.0}

    async def connect() -> Tracker:
        return await kind.open(Surroundings(settings, "", "hexapod", (), {}, SCALE))

    async def target() -> tuple[float, float, float]:
        x, y, z = world.smr_in_tracker("smr1", np.array([clock.now()]))[0]
        return float(x), float(y), float(z)

    async def hide() -> None:
        world.faults.inject("tracker-lost")

    async def silence() -> None:
        world.faults.inject("tracker-silent")

    try:
        yield TrackerBench(connect, LONGEST_S, target, hide, silence)
    finally:
        await server.stop()


@pytest.mark.parametrize("law", TRACKER_LAWS, ids=str)
async def test_it_holds_the_laws(kind: Kind[Tracker], law: Law) -> None:
    async with line_bench(kind) as bench:
        if reason := await why_not(law, bench):
            pytest.skip(reason)
        await law.run(bench)


def test_its_kind_is_listed_with_its_settings(
    installed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(installed))
    words = command_of("site", "kinds", "line-stream", "--json")
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60)
    (found,) = json.loads(done.stdout)["kinds"]
    assert found["role"] == "tracker"
    assert [one["name"] for one in found["settings"]] == ["address", "sigma_mm", "silence_s"]


@pytest.mark.long
def test_a_measurement_with_it(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(installed))
    monkeypatch.chdir(tmp_path)
    station = "mock hexapod --lines --smrs 1 --no-base-smrs --scale 40 --json --site site.toml"
    words = command_of(*station.split(), "--until-stdin-closes")
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as mock:
        assert mock.stdin is not None
        assert mock.stdout is not None
        assert mock.stdout.readline()
        (tmp_path / "poses.csv").write_text(POSES, encoding="utf-8")
        said = pkmcal("measure", "--site", "site.toml", "--poses", "poses.csv", "--unattended")
        mock.stdin.close()
        mock.wait(20)
    assert "not done: this tracker has no two faces" in said
    (run,) = tmp_path.glob("sessions/*/run")
    header, *rows = (run / "points.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) >= 2 * 3 + 2 * 4  # two poses, three nests; the base before and after
    assert "air_temp_C" not in header  # nothing measures it


def pkmcal(*arguments: str) -> str:
    """What a verb prints on both streams; it must end well."""
    done = subprocess.run(
        command_of(*arguments), capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr
