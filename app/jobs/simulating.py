"""Simulate a measuring run, with noise and, if wanted, something wrong with the machine."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from app.files.machines import load_machine, shipped_machines
from app.files.poses import read_any_poses
from app.files.runs import HEADER, POINTS
from app.jobs.chosen_runs import File, path_of
from app.jobs.record import Report
from app.prototype import ONLY_MOCKS, simulate_prototype
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.task import task_values
from mocks.hidden.table import Hidden
from mocks.physics.arm_body import ArmBody, is_arm
from mocks.physics.bodies import BODIES, body_named
from mocks.physics.body import Body
from mocks.physics.truth import read_parameters
from mocks.simulate import Profile, RunPlan, SimulatedRun
from mocks.simulate import simulate as simulate_run
from mocks.simulate.files import write


@dataclass(frozen=True, kw_only=True)
class SimulationReport(Report):
    """What was simulated (``pkm-simulated/1``): the run's folder, and the file of the truth."""

    FORMAT: ClassVar[str] = "pkm-simulated/1"
    machine: str
    run: str
    truth: str
    seed: int
    poses: int
    readings: int
    hidden: Mapping[str, Any]


def simulate(
    machine: str,
    run: File,
    *,
    seed: int = 1,
    poses: int | File = 60,
    noise_um: float | None = None,
    effects: Mapping[str, float] | None = None,
    hidden: File | None = None,
    truth: File | None = None,
    parameters: File | None = None,
    controller: File | None = None,
    cycles: int = 1,
    order: Literal["nest-by-nest", "pose-by-pose"] = "nest-by-nest",
    payload: Sequence[float] = (),
    rise: float = 6.0,
    delays: bool = False,
    strays: int = 0,
    title: str = "",
) -> SimulationReport:
    """Write a simulated run of a machine, and apart from it the truth.

    For the hexapod, the tripod and the ptm the physics is that of the mock machines and shares
    nothing with the model that is fitted; so it is for arms, as soon as something is to be hidden.
    Any other machine is a virtual prototype: errors within its tolerances, without hidden effects.
    The same seed gives the same run; changing the noise changes nothing else.

    Parameters
    ----------
    machine : str
        A shipped machine's name, or a machine file.
    run : path
        Folder to write, which holds no run yet.
    seed : int
        Draws truth, room, noise and poses.
    poses : int or path
        How many random reachable poses, or a poses file (a table where it ends in ``.csv``).
    noise_um : float, optional
        Standard deviation of a reading per axis, um; without, as a tracker's own.
    effects : mapping, optional
        Hidden effects by parameter, mm, rad, K, N: ``{"backlash.leg3": 0.015}``.
    hidden : path, optional
        A file of more of them, table ``[hidden]``.
    truth : path, optional
        Where the truth goes; ``truth.json`` in the run's folder if missing.
    parameters, controller : path, optional
        Files of the true parameters (drawn if missing) and of those that the controller uses.
    cycles : int
        Visits of all poses.
    order : "nest-by-nest" or "pose-by-pose"
        One SMR that is carried, or one in every nest.
    payload : sequence of float
        kg; several are put on in turn.
    rise : float
        Warming of the structure over the run, K.
    delays : bool
        Write a column ``delay_s``.
    strays : int
        So many wrong readings.
    title : str

    Returns
    -------
    SimulationReport

    Raises
    ------
    BadInput
        For what cannot be simulated, a folder that holds a run, and files that cannot be read.

    Examples
    --------
    >>> pkmcal.simulate(                                                     # doctest: +SKIP
    ...     "hexapod", "run", seed=3, effects={"backlash.leg3": 0.015}
    ... ).readings
    200
    """
    out, place = Path(run), path_of(truth)
    _require_fresh(out, place)
    options = {
        "seed": seed, "noise_um": noise_um, "cycles": cycles, "order": order, "delays": delays,
        "strays": strays, "title": title,
    }  # fmt: skip
    asked = {
        **options, "poses": str(poses), "hidden": hidden, "parameters": parameters,
        "controller": controller, "payload": tuple(payload), "effect": tuple(effects or ()),
    }  # fmt: skip
    body = _body(machine, asked)
    if body is None:
        return SimulationReport.of(simulate_prototype(machine, out, place, asked))
    if noise_um is not None and noise_um <= 0.0:
        raise BadInput(f"--noise-um must be positive, got {noise_um}", remedy="Correct the options")
    if cycles < 1:
        raise BadInput(f"--cycles must be at least 1, got {cycles}", remedy="Correct the options")
    described = body.machine
    try:
        known = {} if hidden is None else dict(Hidden.read(Path(hidden)).values)
        plan = RunPlan(
            machine=machine if machine in shipped_machines() else os.path.relpath(machine, out),
            own_body=body,
            seed=seed,
            poses=_poses(described, poses),
            noise_mm=None if noise_um is None else 1e-3 * noise_um,
            hidden=Hidden({**known, **(effects or {})}),
            parameters=None if parameters is None else read_parameters(Path(parameters), described),
            controller={} if controller is None else read_parameters(Path(controller), described),
            cycles=cycles,
            profile=Profile(rise_K=rise, payload_kg=tuple(payload) or (0.0,)),
            order=order,
            delays=delays,
            strays=strays,
            title=title,
        )
        made = simulate_run(plan)
    except (ValueError, ArithmeticError) as wrong:
        raise BadInput(str(wrong), remedy="Correct the options") from wrong
    write(made, out, place)
    return SimulationReport.of(_said(made, out, place or out / "truth.json"))


def _require_fresh(out: Path, truth: Path | None) -> None:
    """Refuse a folder that holds a run, and a truth that would lie among a run's files."""
    if truth is not None and truth.parent.resolve() == out.resolve() and truth.name != "truth.json":
        raise BadInput(f"{truth} lies in the run's folder", remedy="Put the truth elsewhere")
    for path in (out / HEADER, out / POINTS):
        if path.exists():
            raise BadInput(
                "there is a run already, and a run is never written to",
                place=str(path),
                remedy="Choose another folder",
            )


def _body(machine: str, asked: Mapping[str, Any]) -> Body | None:
    """What physics a machine has; None for a virtual prototype."""
    if machine in BODIES:
        return body_named(machine)
    if all(asked[key] == rest for key, rest in ONLY_MOCKS.items()):
        return None
    described = load_machine(machine)
    return ArmBody(described) if is_arm(described) else None


def _poses(described: Machine, poses: int | File) -> int | np.ndarray:
    """A number, or poses (N, k) in the machine's task coordinates."""
    if isinstance(poses, int):
        if poses < 1:
            raise ValueError("--poses must be at least 1")
        return poses
    rows = np.array(list(read_any_poses(Path(poses), described).values()))
    return np.asarray(task_values(described.task, Poses.from_xyz_rpy(rows.T)).T)


def _said(run: SimulatedRun, out: Path, truth: Path) -> dict[str, Any]:
    return {
        "format": "pkm-simulated/1",
        "machine": run.plan.body.machine.name,
        "run": str(out),
        "truth": str(truth),
        "seed": run.plan.seed,
        "poses": len(run.poses),
        "readings": int(run.layout.reading.sum()),
        "hidden": run.plan.hidden.values,
    }
