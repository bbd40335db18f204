"""From wanted poses to what to command, with all that a model knows; nothing moves

Wanted poses, load and temperature in; actuator values or poses out. See docs/correct.md.
"""

import asyncio
import csv
import io
import json
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from app.show.text_table import text_table
from calib.errors import BadInput
from calib.quantity import quantity

if TYPE_CHECKING:
    from app.files.wanted_poses import Wanted
    from app.jobs.correcting import CorrectReport
    from app.jobs.corrector import Corrector


@click.command()
@click.argument("model", type=click.Path(path_type=Path))
@click.option("--pose", help='One pose, mm and rad or with units: "0, 0, 220, 0, 2 deg, 0".')
@click.option("--poses", type=click.Path(path_type=Path), help="A table (.csv) or a poses file.")
@click.option("--machine", help="Machine file, where it is not the one that MODEL names.")
@click.option("--payload", type=float, help="Payload, kg.")
@click.option("--temperature", type=float, help="Temperature of the structure, deg C.")
@click.option("--channel", "channels", multiple=True, help="Another reading: NAME=VALUE.")
@click.option("--every", type=click.FloatRange(min=0.0), help="Seconds from pose to pose.")
@click.option("--from", "before", help="Pose before the first, else home.")
@click.option(
    "--as",
    "sent",
    type=click.Choice(["q", "pose"]),
    default="q",
    show_default=True,
    help="Actuator values, or poses for a controller with parameters of its own.",
)
@click.option("--extrapolate", is_flag=True, help="Answer outside of where MODEL was measured.")
@click.option("--out", type=answer.WrittenFile(), help="Write the commands to a table.")
@click.option(
    "--serve",
    type=click.IntRange(0, 65535),
    is_flag=False,
    flag_value=0,
    help="Answer requests on this port of the loopback (any free one without a number).",
)
@answer.json_option
def command(
    model: Path,
    pose: str | None,
    poses: Path | None,
    machine: str | None,
    payload: float | None,
    temperature: float | None,
    channels: tuple[str, ...],
    every: float | None,
    before: str | None,
    sent: str,
    extrapolate: bool,
    out: Path | None,
    serve: int | None,
    as_json: bool,
) -> None:
    """Compute what to command so that the machine, as MODEL has it, comes to the wanted poses.

    Every machine effect of MODEL is in the commands; poses are visited one after the other, as what
    was commanded before counts. Outside of where the machine was measured it refuses, and says how
    far. With --serve it answers requests until it is ended (Ctrl-C). Nothing moves.
    """
    from app.jobs.correcting import report_of
    from app.jobs.corrector import Corrector

    corrector = Corrector.load(model, machine)
    if serve is not None:
        _alone(serve=True, pose=pose, poses=poses, out=out, before=before, every=every)
        asyncio.run(_serve(corrector, serve, as_json))
        return
    wanted = _wanted(corrector, pose, poses)
    told = _told(channels, payload, temperature)
    last = None if before is None else _numbers(before, corrector, "--from")
    report = report_of(corrector, wanted, told, every, last, extrapolate)
    for remark in report.remarks:
        answer.say(f"{remark}.")
    for name, why in report.left_out.items():
        answer.say(f"{name} is not in the commands: {why}.")
    if out is not None:
        out.write_text(_table(report, sent), encoding="utf-8", newline="")
        answer.say(f"commands written to {out}")
    answer.show(report.to_json(), as_json, _words(report, sent))


def _alone(*, serve: bool, **other: object) -> None:
    if serve and (told := [name for name, value in other.items() if value is not None]):
        raise BadInput(
            f"--{told[0].replace('before', 'from')} is no option of --serve",
            remedy="Send it in the requests",
        )


def _wanted(corrector: "Corrector", pose: str | None, poses: Path | None) -> "Wanted":
    from app.files.wanted_poses import Wanted, read_wanted

    if (pose is None) == (poses is None):
        raise BadInput(
            "both --pose and --poses" if pose else "no pose is given",
            remedy="Give --pose, --poses or --serve",
        )
    if poses is not None:
        return read_wanted(poses, corrector.machine)
    assert pose is not None
    return Wanted(("the pose",), corrector.task_of(_numbers(pose, corrector, "--pose"))[:, None])


def _numbers(text: str, corrector: "Corrector", option: str) -> list[float]:
    """Numbers between commas or blanks, each in mm or rad or with a unit of its own."""
    from calib.mechanism.task import FULL

    parts = text.split(",") if "," in text else text.split()
    own = corrector.coordinates
    names = own if len(parts) == len(own) else FULL
    if len(parts) != len(names):
        corrector.task_of([0.0] * len(parts), option)
    return [
        quantity(_bare(part), "mm" if name in "xyz" else "rad", f"{option}, {name}")
        for name, part in zip(names, parts, strict=True)
    ]


def _bare(part: str) -> float | str:
    try:
        return float(part)
    except ValueError:
        return part.strip()


def _told(
    channels: tuple[str, ...], payload: float | None, temperature: float | None
) -> dict[str, float]:
    from app.jobs.corrector import PAYLOAD, TEMPERATURE

    told = {}
    for one in channels:
        name, sign, value = one.partition("=")
        number = _bare(value)
        if not sign or not name.strip() or not isinstance(number, float):
            raise BadInput(f"--channel {one}", remedy="Write NAME=VALUE with a number")
        told[name.strip()] = number
    given = {PAYLOAD: payload, TEMPERATURE: temperature}
    for name, other in given.items():
        if other is not None and name in told:
            raise BadInput(f"{name} is told twice", remedy="Say it once")
    return told | {name: value for name, value in given.items() if value is not None}


def _columns(report: "CorrectReport", sent: str) -> tuple[str, ...]:
    from calib.mechanism.task import FULL

    return report.actuators if sent == "q" else FULL


def _table(report: "CorrectReport", sent: str) -> str:
    """Commands as a table: label, then actuator coordinates or a pose, every digit of them."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["pose", *_columns(report, sent)])
    for one in report.poses:
        writer.writerow([one.pose_name, *(repr(v) for v in (one.q if sent == "q" else one.pose))])
    return text.getvalue()


def _words(report: "CorrectReport", sent: str) -> str:
    rows = []
    for one in report.poses:
        values = one.q if sent == "q" else one.pose
        spread = f"{one.uncertainty_um:.1f}", f"{one.uncertainty_mdeg:.2f}"
        rows.append([one.pose_name, *(f"{v:.6f}" for v in values), *spread])
    inside = f"in the commands: {', '.join(report.effects) or 'geometry alone'}"
    header = ["", *_columns(report, sent), "+- um", "+- mdeg"]
    lines = [f"{report.machine}; {inside}; mm and rad", "", text_table(header, rows)]
    far = [f"{one.pose_name}: {what}" for one in report.poses for what in one.outside]
    return "\n".join([*lines, *([""] if far else []), *far])


async def _serve(corrector: "Corrector", port: int, as_json: bool) -> None:
    """Answer until SIGINT or SIGTERM."""
    from app.jobs.correction_server import HOST, CorrectionServer

    server, ended = CorrectionServer(corrector, port), asyncio.Event()
    loop = asyncio.get_running_loop()

    def end(*_: Any) -> None:
        loop.call_soon_threadsafe(ended.set)

    corrector.warm_up()
    before = {n: signal.signal(n, end) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        chosen = await server.start()
        for remark in corrector.remarks:
            answer.say(f"{remark}.")
        said = {"format": "pkm-correct-server/1", "host": HOST, "port": chosen}
        click.echo(json.dumps(said) if as_json else f"answering on {HOST}:{chosen}")
        sys.stdout.flush()
        await ended.wait()
        answer.say("ended")
    finally:
        await server.stop()
        for number, handler in before.items():
            signal.signal(number, handler)
