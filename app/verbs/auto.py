"""Measure, find what is missing, correct and verify until a target holds, deciding by itself

Every decision is journaled with its reason before it is carried out; see docs/auto.md.
"""

import asyncio
from pathlib import Path

import click

from app import answer
from app.auto import Limits
from app.defaults import FEWEST_FIRST, MOST_FIRST
from app.jobs.automatic import AutoReport


@click.command()
@click.option(
    "--site", "site_file", required=True, type=click.Path(path_type=Path), help="Site file."
)
@click.option(
    "--target-um",
    type=click.FloatRange(min=0.0, min_open=True),
    help="RMS position error at fresh poses that is wanted.",
)
@click.option(
    "--hours", type=click.FloatRange(min=0.0, min_open=True), help="Machine time for all of it."
)
@click.option(
    "--first",
    default=15,
    show_default=True,
    type=click.IntRange(FEWEST_FIRST, MOST_FIRST),
    help="Poses to begin with.",
)
@click.option("--no-apply", is_flag=True, help="Write nothing to the machine.")
@click.option("--seed", default=1, show_default=True, help="Draws the candidates for poses.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of the journal; one that exists is gone on with.  [default: auto-<date and time>]",
)
@click.option("--unattended", "alone", is_flag=True, help="Nobody answers questions or says no.")
@answer.json_option
def command(
    site_file: Path,
    target_um: float | None,
    hours: float | None,
    first: int,
    no_apply: bool,
    seed: int,
    out: Path | None,
    alone: bool,
    as_json: bool,
) -> None:
    """Calibrate the machine of a site until fresh poses show the wanted accuracy.

    A first set is measured; then, again and again: what is missing is looked for, what cannot be
    told apart is measured for, more poses are measured while the prediction is above the target,
    and what is good enough is written through the gates and verified at fresh poses. It stops
    when the target holds, when nothing that can be afforded would change the answer, or at the
    limit. With somebody at the terminal every decision is asked first: it may be skipped, or
    another one chosen.
    """
    from app.auto.flight import folder_of, limits_of
    from app.console import unattended

    folder = folder_of(out)
    limits = limits_of(folder, target_um, hours, first, apply=not no_apply)
    report = asyncio.run(
        fly(site_file, folder, limits, seed, alone=unattended(alone), quiet=as_json)
    )
    answer.show(report.to_json(), as_json, words(report))


async def fly(
    site_file: Path, folder: Path, limits: Limits, seed: int, *, alone: bool, quiet: bool
) -> AutoReport:
    """Decide and do on a site's station; ``quiet``: of sessions nothing is told but decisions."""
    from app.auto.flight import Flight
    from app.auto.station import StationLaboratory
    from app.console import ConsoleFace, stopping
    from app.files.site import load_site
    from app.session.station import Station

    station = Station(load_site(site_file))
    laboratory = StationLaboratory(station, folder / "sessions", unattended=alone)
    station.observers.watch(ConsoleFace(laboratory.answer, 0, quiet=quiet).hear)
    flight = Flight(laboratory, folder, limits, seed, None if alone else ask, answer.say)
    try:
        with stopping(flight.stop):
            return await flight.run()
    finally:
        await station.close()


async def ask(text: str, answers: tuple[str, ...], typed: str) -> str:
    """Ask the person at the terminal; answers are numbered, the first is proposed."""
    from app.auto.wording import understood
    from app.console import in_daemon_thread

    def asked() -> str:
        for number, one in enumerate(answers, start=1):
            answer.say(f"  {number}  {one}")
        while True:
            which = f"Which ({typed})" if typed else "Which"
            given: str = click.prompt(f"{text}. {which}", default="1", err=True)
            if given in answers or understood(typed, given):
                return given
            if given.isdigit() and 1 <= int(given) <= len(answers):
                return answers[int(given) - 1]
            answer.say(f"one of 1 to {len(answers)}")

    return await in_daemon_thread(asked)


def words(report: AutoReport) -> str:
    """Say how it went to a person."""
    from app.auto.wording import open_words

    outcome = {True: "reached", False: "not reached", None: "nothing was to be written"}
    lines = [
        f"target {report.target_um:g} um: {outcome[report.reached]}. {report.why}",
        f"{report.poses} poses in {report.minutes:.0f} min of machine time; "
        f"effects: {', '.join(report.effects) or 'none'}",
    ]
    lines += open_words(report)
    lines.append(f"journal: {report.folder}")
    if report.model is not None:
        lines.append(f"model: {report.model}")
    return "\n".join(lines)
