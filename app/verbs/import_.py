"""Bring what instruments and programs export to a run

By a map that says what the columns are. See docs/import.md.
"""

from pathlib import Path
from typing import Any

import click

from app import answer
from app.files.shipped_maps import shipped_maps
from app.show.text_table import text_table
from calib.errors import BadInput

FILE = click.Path(path_type=Path, dir_okay=False)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=FILE)
@click.option(
    "--map", "plan", metavar="MAP", help=f"A map's file, or one of {', '.join(shipped_maps())}."
)
@click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="RUN", help="Folder to write."
)
@click.option("--machine", help="Machine file or name, in place of the one that the map names.")
@click.option("--header", type=FILE, help="A run.toml with machine and nests, if MAP has none.")
@click.option("--commands", type=FILE, help="What was commanded, if it is a file of its own.")
@click.option("--guess", is_flag=True, help="Write a first map to --out, and show three rows.")
@click.option("--as-it-stands", is_flag=True, help="Write it even if the data prove MAP wrong.")
@answer.json_option
def command(
    files: tuple[Path, ...],
    plan: str | None,
    out: Path,
    machine: str | None,
    header: Path | None,
    commands: Path | None,
    guess: bool,
    as_it_stands: bool,
    as_json: bool,
) -> None:
    """Bring FILE... to a run by a map: columns, units, signs, poses, nests, times.

    Nothing is guessed silently: what neither MAP nor FILE states is refused or listed, and the list
    is written into run.toml. At the end the data themselves are asked for the usual mistakes
    (units, signs, frames, nests); what they prove is refused with what to change. --guess writes a
    first map, with remarks, to the file named with --out.
    """
    from app.jobs.guessing import guess_map
    from app.jobs.importing import import_run

    if guess:
        if plan or commands or header:
            raise click.UsageError("--guess takes no --map, --header or --commands")
        guessed = guess_map(files, out, machine=machine).to_json()
        answer.show(guessed, as_json, _guessed_words(guessed))
        return
    if plan is None:
        raise BadInput(
            "no map is named", place="--map",
            remedy=f"Name a file or one of {', '.join(shipped_maps())}; --guess writes a first one",
        )  # fmt: skip
    report = import_run(
        files,
        plan,
        out,
        machine=machine,
        header=header,
        commands=commands,
        as_it_stands=as_it_stands,
    ).to_json()
    answer.show(report, as_json, _words(report))


def _words(report: dict[str, Any]) -> str:
    from app.show.record_words import record_lines

    lines = [
        *record_lines(report),
        f"{', '.join(report['runs'])}: {report['readings']} readings at {report['poses']} poses of "
        f"{report['machine']}",
    ]
    if report["assumed"]:
        lines += ["Assumed (also in run.toml):", *(f"  {one}" for one in report["assumed"])]
    if not report["record"]:
        lines += ["The data contradict none of it."]
    return "\n".join(lines)


def _guessed_words(report: dict[str, Any]) -> str:
    header, *rows = report["preview"]
    lines = [
        f"{report['map']}: a first map of {report['columns']} columns and {report['rows']} rows",
        "",
        text_table(header, rows) if rows else "no rows",
        "",
        "Assumed:",
        *(f"  {one}" for one in report["assumed"]),
        "To be completed:",
        *(f"  {one}" for one in report["missing"]),
    ]
    return "\n".join(lines)
