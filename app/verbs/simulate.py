"""Simulate a measuring run of a machine, with noise and, if wanted, something wrong with it"""

from pathlib import Path
from typing import Any

import click
import numpy as np

from app import answer
from app.files.poses import read_any_poses
from app.files.runs import HEADER, POINTS
from app.prototype import simulate_prototype
from calib.errors import BadInput
from calib.mechanism.rigid import Poses
from calib.mechanism.task import task_values
from mocks.hidden.table import Hidden
from mocks.physics.bodies import BODIES, body_named
from mocks.physics.truth import read_parameters
from mocks.simulate import Profile, RunPlan, SimulatedRun, simulate
from mocks.simulate.files import write

FOLDER = click.Path(path_type=Path, file_okay=False)
FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.argument("machine")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    metavar="RUN",
    help="Folder of the run.",
)
@click.option("--seed", default=1, show_default=True, help="Draws truth, room, noise and poses.")
@click.option("--poses", default="60", show_default=True, metavar="N|FILE", help="How many, which.")
@click.option("--noise-um", type=float, help="Per axis; without: as a tracker's own.")
@click.option("--hidden", type=FILE, help="File of hidden effects, table [hidden].")
@click.option("--effect", multiple=True, metavar="NAME=VALUE", help="A hidden effect; repeatable.")
@click.option("--truth", type=FILE, help="Where the truth goes.  [default: RUN/truth.json]")
@click.option("--parameters", type=FILE, help="File of true parameters; without: drawn.")
@click.option("--controller", type=FILE, help="File of the parameters that the controller uses.")
@click.option("--cycles", default=1, show_default=True, help="Visits of all poses (ISO 9283).")
@click.option(
    "--order",
    type=click.Choice(["nest-by-nest", "pose-by-pose"]),
    default="nest-by-nest",
    show_default=True,
    help="One SMR that is carried, or one in every nest.",
)
@click.option("--payload", type=float, multiple=True, help="kg; repeated: put on in turn.")
@click.option("--rise", default=6.0, show_default=True, help="Warming of the structure, K.")
@click.option("--delays", is_flag=True, help="Write a column delay_s.")
@click.option("--strays", default=0, show_default=True, help="So many wrong readings.")
@click.option("--title", default="", help="Of the run.")
@answer.json_option
def command(machine: str, out: Path, truth: Path | None, as_json: bool, **options: Any) -> None:
    """Write a simulated run of MACHINE, and apart from it the truth.

    For the hexapod, the tripod and the ptm the physics is that of the mock machines and shares
    nothing with the model that is fitted. Any other machine, also one of your own, is a virtual
    prototype: errors within its tolerances, solved exactly by the engine, without hidden effects.
    The same seed gives the same run; changing the noise changes nothing else. FILE with poses is
    a poses file or a CSV table.
    """
    if truth is not None and truth.parent.resolve() == out.resolve() and truth.name != "truth.json":
        raise BadInput(f"{truth} lies in the run's folder", remedy="Put the truth elsewhere")
    for path in (out / HEADER, out / POINTS):
        if path.exists():
            raise BadInput(
                "there is a run already, and a run is never written to",
                place=str(path),
                remedy="Choose another folder",
            )
    if machine not in BODIES:
        report = simulate_prototype(machine, out, truth, options)
        answer.show(report, as_json, _words(report))
        return
    try:
        run = simulate(_plan(machine, **options))
    except (ValueError, ArithmeticError) as wrong:
        raise BadInput(str(wrong), remedy="Correct the options") from wrong
    write(run, out, truth)
    report = _report(run, out, truth or out / "truth.json")
    answer.show(report, as_json, _words(report))


def _words(report: dict[str, Any]) -> str:
    return (
        f"{report['run']}: {report['readings']} readings at {report['poses']} poses of "
        f"{report['machine']}; the truth is in {report['truth']}"
    )


def _plan(
    machine: str,
    *,
    seed: int,
    poses: str,
    noise_um: float | None,
    hidden: Path | None,
    effect: tuple[str, ...],
    parameters: Path | None,
    controller: Path | None,
    cycles: int,
    payload: tuple[float, ...],
    rise: float,
    **rest: Any,
) -> RunPlan:
    """The campaign that the options ask for; raises ValueError or BadInput."""
    described = body_named(machine).machine
    table = {} if hidden is None else dict(Hidden.read(hidden).values)
    for text in effect:
        name, sign, value = text.partition("=")
        if not sign:
            raise ValueError(f'"{text}" is no NAME=VALUE')
        table[name.strip()] = float(value)
    if noise_um is not None and noise_um <= 0.0:
        raise ValueError(f"--noise-um must be positive, got {noise_um}")
    if cycles < 1:
        raise ValueError(f"--cycles must be at least 1, got {cycles}")
    return RunPlan(
        machine=machine,
        seed=seed,
        poses=_poses(machine, poses),
        noise_mm=None if noise_um is None else 1e-3 * noise_um,
        hidden=Hidden(table),
        parameters=None if parameters is None else read_parameters(parameters, described),
        controller={} if controller is None else read_parameters(controller, described),
        cycles=cycles,
        profile=Profile(rise_K=rise, payload_kg=payload or (0.0,)),
        **rest,
    )


def _poses(machine: str, text: str) -> int | np.ndarray:
    """A number, or poses (N, k) in the machine's task coordinates."""
    if text.isdigit():
        if int(text) < 1:
            raise ValueError("--poses must be at least 1")
        return int(text)
    described = body_named(machine).machine
    rows = np.array(list(read_any_poses(Path(text), described).values()))
    return np.asarray(task_values(described.task, Poses.from_xyz_rpy(rows.T)).T)


def _report(run: SimulatedRun, out: Path, truth: Path) -> dict[str, Any]:
    return {
        "format": "pkm-simulated/1",
        "machine": run.plan.machine,
        "run": str(out),
        "truth": str(truth),
        "seed": run.plan.seed,
        "poses": len(run.poses),
        "readings": int(run.layout.reading.sum()),
        "hidden": run.plan.hidden.values,
    }
