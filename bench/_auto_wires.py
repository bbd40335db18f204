"""Worlds on the wire: a mock station in a process of its own, and ``pkmcal auto`` in another.

Nobody is there: the program is started as a script starts it, and speaks to the station over CAN
(slcan on TCP) and the tracker's TCP. What it came to is judged as in simulated worlds, and by the
station's own truth at fresh poses, for which it is asked when everything is over.
"""

import asyncio
import json
import subprocess
import tempfile
import time
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from app.again import command_of
from app.auto.findings import fresh_poses
from app.demo.station import mock_station
from app.files.machines import load_machine
from app.files.site import load_site
from app.jobs.predicting import predict
from app.jobs.verifying import begin_verifying
from app.session.session import Session
from app.verification import judge_session
from bench._auto_worlds import (
    FIXED,
    FROM_COLD,
    HOURS,
    MACHINE,
    OF_THE_TRACKER,
    QUIET_MM,
    Came,
    World,
    hidden_in,
    without,
)
from mocks.control import ControlClient
from mocks.hidden.table import Hidden
from mocks.simulate.files import write
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

SCALE, TAU_S = 600.0, 30.0
"""Machine seconds in a second; how slow the tracker's noise is."""
DEADLINE_S = 2000.0
"""Of one call of the program."""


class WireWorld:
    """One world in a folder: its station is the same machine each time it is started.

    Parameters
    ----------
    folder : Path
        It is there.
    seed : int
        Draws the true parameters, the room and the noise.
    machine : str
    hidden : mapping of str to float
    """

    def __init__(self, folder: Path, seed: int, machine: str, hidden: Mapping[str, float]) -> None:
        self.folder, self.seed, self.machine, self.hidden = folder, seed, machine, dict(hidden)

    def _station(self, name: str) -> tuple[Path, Sequence[str]]:
        """A folder for one station, and what it is told beyond its seed."""
        folder = self.folder / name
        folder.mkdir()
        table = folder / "hidden.json"
        table.write_text(json.dumps(self.hidden), encoding="utf-8")
        return folder, ["--hidden", str(table), "--noise-tau", str(TAU_S)]

    def decides_by_itself(self, target_um: float, hours: float) -> dict[str, Any]:
        """What ``pkmcal auto`` came to, with the true errors of machine and model."""
        folder, more = self._station(f"{target_um:g}")
        began = time.monotonic()
        with mock_station(self.machine, self.seed, SCALE, folder, more) as site:
            report = called(
                "auto", "--site", str(site), "--target-um", f"{target_um:g}", "--hours",
                f"{hours:g}", "--unattended", "--out", str(folder / "auto"),
            )  # fmt: skip
            truth = asked_truth(site)
            machine_um = as_it_stands_um(site, folder)
        model_um = self._model_um(Path(report["model"]), truth, folder)
        return {
            "report": report, "machine_um": machine_um, "model_um": model_um,
            "wall_s": time.monotonic() - began,
        }  # fmt: skip

    def fixed_plan(self, count: int) -> dict[str, Any]:
        """What ``count`` poses for accuracy, measured at once, came to."""
        folder, more = self._station("fixed")
        poses, model = folder / "poses.toml", folder / "model.toml"
        with mock_station(self.machine, self.seed, SCALE, folder, more) as site:
            called("poses", "--site", str(site), "--n", str(count), "--out", str(poses))
            run = called(
                "measure", "--site", str(site), "--poses", str(poses), "--unattended",
                "--folder", str(folder / "sessions"),
            )["run"]  # fmt: skip
            truth = asked_truth(site)
        found = called("discover", run, "--save", str(model))
        return {"found": found, "model_um": self._model_um(model, truth, folder)}

    def _model_um(self, model: Path, truth: Mapping[str, Any], folder: Path) -> float:
        """RMS of what a model does not know of the station's machine at fresh poses."""
        poses = fresh_poses(load_machine(self.machine))
        plan = RunPlan(
            machine=self.machine,
            seed=self.seed + 1_000_000,
            poses=np.array(list(poses.values())),
            noise_mm=QUIET_MM,
            hidden=Hidden(without(self.hidden, FROM_COLD + OF_THE_TRACKER)),
            parameters=truth["parameters"],
            profile=Profile(rise_K=2.0),
            delays=True,
        )
        run = folder / "quiet"
        write(simulate(plan), run, folder / "quiet-truth.json")
        return float(predict(model, str(run), frame=True).rms_um or np.nan)


def called(*arguments: str) -> dict[str, Any]:
    """The JSON answer of a verb that is called as a script calls it.

    Raises
    ------
    RuntimeError
        If it does not come to its end, with what it said last.
    """
    done = subprocess.run(
        command_of(*arguments, "--json"), capture_output=True, text=True, timeout=DEADLINE_S,
        stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    if done.returncode:
        said = done.stderr.strip().splitlines() or [done.stdout.strip()]
        raise RuntimeError(f"pkmcal {' '.join(arguments)}: exit {done.returncode}: {said[-1]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def asked_truth(site: Path) -> dict[str, Any]:
    """What only a judge may ask of a station."""
    address = tomllib.loads(site.read_text(encoding="utf-8"))["hands"]["control"]
    with ControlClient(address) as tell:
        return tell("truth")


def as_it_stands_um(site: Path, folder: Path) -> float:
    """True RMS position error of the machine at fresh poses, with what its controller holds."""
    loaded = load_site(site)
    session = begin_verifying(
        loaded, fresh_poses(loaded.machine), folder=folder / "judged", truth=True, unattended=True
    )
    asyncio.run(_ran(session))
    seen = judge_session(session.folder).truth
    assert seen is not None
    return seen.position_rms_um


async def _ran(session: Session) -> None:
    try:
        await session.connect()
        await session.run()
    finally:
        await session.close()


def tried_on_wires(world: World, targets_um: Sequence[float]) -> dict[str, Came]:
    """The autopilot for each target, and the fixed plan, in one world on the wire."""
    with tempfile.TemporaryDirectory() as made:
        on = WireWorld(Path(made), world.seed, MACHINE, hidden_in(world))
        came = {f"{target:g}": _auto_on_wires(world, on, target) for target in targets_um}
        return {**came, "fixed": _fixed_on_wires(world, on)}


def _auto_on_wires(world: World, on: WireWorld, target_um: float) -> Came:
    one = on.decides_by_itself(target_um, HOURS)
    report = one["report"]
    named = set(report["effects"])
    verified = sum(entry["came"].startswith("fresh poses") for entry in report["decisions"])
    fresh = len(fresh_poses(load_machine(MACHINE)))
    return Came(
        3 * report["poses"], 3 * fresh * verified, one["model_um"],
        set(world.effects) <= named, len(named - set(world.effects)), len(report["in_question"]),
        report["reached"], one["machine_um"], report["minutes"], one["wall_s"],
    )  # fmt: skip


def _fixed_on_wires(world: World, on: WireWorld) -> Came:
    one = on.fixed_plan(FIXED)
    found = one["found"]
    named = set(found["effects"])
    return Came(
        3 * FIXED, 0, one["model_um"], set(world.effects) <= named,
        len(named - set(world.effects)), len(found["indistinguishable"]),
    )  # fmt: skip
