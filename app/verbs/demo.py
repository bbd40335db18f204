"""Show the whole job on a mock hexapod: measure, identify, correct, verify

The mock is a process of its own, reached over slcan and the tracker's TCP protocol.
"""

import asyncio
import json
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.auto import Limits
from app.demo.station import mock_station
from app.errors import StoppedByOperator
from app.show.text_table import text_table
from app.verbs import auto

if TYPE_CHECKING:
    from app.demo.job import Demo, Outcome

COLUMNS = ("peak um", "std um", "peak deg", "std deg")
REAL_TIME_EVERY, REAL = 6, 100.0
"""With a controller that moves in real time: poses to verify, machine seconds in a second."""
AUTO_UM, PLAY = 8.0, {"backlash.leg4": 0.02}
"""With --auto: what is wanted, um RMS, and what is hidden (mm)."""


@click.command()
@click.option("--seed", default=1, show_default=True, help="Which machine, room and noise.")
@click.option(
    "--poses",
    "count",
    default=29,
    show_default=True,
    type=click.IntRange(10, 200),
    help="Poses to measure.",
)
@click.option(
    "--scale",
    default=600.0,
    show_default=True,
    type=click.FloatRange(1.0, 2000.0),
    help="Machine seconds in one second.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder to make.  [default: out/demo-<date and time>]",
)
@click.option(
    "--bare",
    "device",
    flag_value="--bare",
    help="Drives alone, without a controller: the host computes the legs.",
)
@click.option(
    "--pose",
    "device",
    flag_value="--pose",
    help="A closed controller that takes poses: the host corrects them.",
)
@click.option(
    "--linuxcnc",
    "device",
    flag_value="--linuxcnc",
    help="LinuxCNC itself, installed on this computer, moves simulated motors.",
)
@click.option(
    "--auto",
    "target_um",
    type=click.FloatRange(min=0.0, min_open=True),
    is_flag=False,
    flag_value=AUTO_UM,
    metavar="[UM]",
    help=f"Let the program decide what to measure until UM holds ({AUTO_UM:g} if not said), on a "
    "machine with play in one leg.",
)
@click.option(
    "--lead",
    default=0.0,
    help="Lead of the mock's screws, mm, if they have no guide; screw-twist is then in the model.",
)
@answer.json_option
def command(
    seed: int,
    count: int,
    scale: float,
    out: Path | None,
    device: str | None,
    target_um: float | None,
    lead: float,
    as_json: bool,
) -> None:
    """Calibrate a mock hexapod without a person, and write a report.

    Verifies 216 poses, measures the chosen ones with a laser tracker over TCP, identifies 54
    parameters, writes them to the motion controller over CAN, and verifies again. With --bare
    or --pose the parameters stay here, in a host store, and every command is computed with them.
    With --linuxcnc 42 parameters go into LinuxCNC's HAL pins and files; it moves in real time, so
    every sixth pose is verified, and a second holds 100 at most.
    """
    from rich.console import Console

    from app.demo.job import Demo
    from app.demo.screen import DemoScreen, result_lines

    folder = out or Path("out") / f"demo-{datetime.now():%Y%m%d-%H%M%S}"
    folder.mkdir(parents=True, exist_ok=True)
    folder = folder.resolve()
    if target_um is not None:
        _automatic(folder, seed, scale, target_um, as_json)
        return
    screen = DemoScreen(Console(stderr=True, highlight=False, quiet=as_json))
    began = time.monotonic()
    more, every = [device] if device else [], 1
    if device == "--linuxcnc":
        more, every, scale = [device, str(folder / "linuxcnc")], REAL_TIME_EVERY, min(scale, REAL)
    add = []
    if lead:
        hidden = folder / "hidden.json"
        hidden.write_text(json.dumps({"screw-twist.L": lead}), encoding="utf-8")
        more, add = [*more, "--hidden", str(hidden)], ["screw-twist"]
    with screen.shown(), mock_station("hexapod", seed, scale, folder, more) as site_file:
        demo = Demo(folder, count, seed, screen.watcher, every, add)
        outcome = asyncio.run(_run(demo, site_file))
    rows = result_lines(outcome)
    head = (f"{len(outcome.after.labels)} poses", *COLUMNS)
    answer.show(
        _json(outcome, time.monotonic() - began),
        as_json,
        f"{text_table(head, rows)}\n\nreport: {outcome.report}",
    )


def _automatic(folder: Path, seed: int, scale: float, target_um: float, as_json: bool) -> None:
    """The same job, every decision left to the program; see docs/auto.md."""
    hidden = folder / "hidden.json"
    hidden.write_text(json.dumps(PLAY), encoding="utf-8")
    limits = Limits(target_um)
    with mock_station("hexapod", seed, scale, folder, ["--hidden", str(hidden)]) as site_file:
        report = asyncio.run(auto.fly(site_file, folder, limits, seed, alone=True, quiet=True))
    answer.show(report.to_json(), as_json, auto.words(report))


async def _run(demo: "Demo", site_file: Path) -> "Outcome":
    from app.console import stopping

    try:
        with stopping(demo.stop):
            return await demo.run(site_file)
    except asyncio.CancelledError:
        raise StoppedByOperator() from None


def _json(outcome: "Outcome", seconds: float) -> dict[str, object]:
    return {
        "format": "pkm-demo/1",
        "before": {k: v for k, v in outcome.before.to_json().items() if k != "errors"},
        "after": {k: v for k, v in outcome.after.to_json().items() if k != "errors"},
        "report": str(outcome.report),
        "seconds": seconds,
    }
