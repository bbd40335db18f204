"""Write a fit to the controller: gates, trial, check poses, and only then keep"""

import asyncio
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from app.defaults import LIMITS
from app.show.text_table import text_table
from calib.digits import Digits, fixed
from calib.errors import BadInput

if TYPE_CHECKING:
    from app.files.fits import SavedFit
    from app.files.site import Site
    from app.writeback.gates import Gates
    from app.writeback.procedure import Applied
    from app.writeback.proposal import Change, Proposal
    from calib.pose_error import Summary

TABLE_ENTRY = re.compile(r"(.+-table\.[^.]+)\.\d+")


@click.command(
    epilog="Gates and their limits: " + ", ".join(f"{k} {v:g}" for k, v in LIMITS.items())
)
@click.argument("fit_file", type=click.Path(path_type=Path))
@click.option(
    "--site", "site_file", required=True, type=click.Path(path_type=Path), help="Site file."
)
@click.option("--dry-run", is_flag=True, help="Show the table and the gates; write nothing.")
@click.option("--yes", is_flag=True, help="Keep without asking, if every gate passes.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="GATE=VALUE",
    help="Change a gate's limit, knowingly (repeatable).",
)
@click.option("--unattended", "alone", is_flag=True, help="Nobody answers questions.")
@click.option(
    "--folder",
    default="sessions",
    type=click.Path(path_type=Path),
    help="Where the sessions of the check poses get their folders.",
)
@answer.json_option
def command(
    fit_file: Path,
    site_file: Path,
    dry_run: bool,
    yes: bool,
    limits: tuple[str, ...],
    alone: bool,
    folder: Path,
    as_json: bool,
) -> None:
    """Write what pkmcal fit --save found to the controller.

    A snapshot is taken first. The new values go to volatile memory and are read back bit for bit;
    check poses are measured before and after; only what passes every gate and is confirmed is
    stored, loaded again and read back. Any failure brings the snapshot back. Effects of the
    measurement are never written.
    """
    from app.files.fits import read_fit
    from app.files.site import load_site
    from app.writeback.gates import Gates

    site = load_site(site_file)
    fit = read_fit(fit_file)
    gates = Gates.with_limits(dict(_limit(text) for text in limits))
    done = asyncio.run(_apply(site, fit, gates, folder, dry_run, yes, alone, as_json))
    answer.show(done[0], as_json, done[1])


def _limit(text: str) -> tuple[str, float]:
    gate, _, value = text.partition("=")
    try:
        return gate, float(value)
    except ValueError:
        raise BadInput(f'--limit "{text}"', remedy="Write GATE=NUMBER") from None


async def _apply(
    site: "Site",
    fit: "SavedFit",
    gates: "Gates",
    folder: Path,
    dry_run: bool,
    yes: bool,
    alone: bool,
    quiet: bool,
) -> tuple[dict[str, Any], str]:
    from app.console import ConsoleFace, in_daemon_thread, stopping, unattended
    from app.jobs.applying import apply_report
    from app.session.station import Station
    from app.writeback.procedure import WriteBack

    station = Station(site)
    alone = unattended(alone)

    async def confirm(proposal: "Proposal", before: "Summary", after: "Summary") -> bool:
        if yes:
            return True
        if alone:
            return False
        answer.say(table(proposal))
        text = (
            f"Check poses: peak {before.position_peak_um:.1f} um before, "
            f"{after.position_peak_um:.1f} um now. Keep these parameters?"
        )
        given = await in_daemon_thread(lambda: "y" if click.confirm(text, err=True) else "n")
        return given == "y"

    job = WriteBack(station, fit, gates, folder, confirm, alone)

    def reply(prompt: str, choice: str) -> None:
        if job.running is not None:
            job.running.answer_prompt(prompt, choice)

    face = ConsoleFace(reply, 0, quiet=quiet)
    leave = station.observers.watch(face.hear)
    try:
        with face.shown(), stopping(job.stop):
            await station.connect()
            if dry_run:
                _, proposal = await job.propose()
                return apply_report(proposal).to_json(), table(proposal) + "\nnothing was written"
            applied = await job.run()
    finally:
        leave()
        await station.close()
    report = apply_report(applied.proposal, applied)
    return report.to_json(), table(applied.proposal) + "\n" + _words(applied)


def table(proposal: "Proposal") -> str:
    """Old, new and difference of every parameter; then what is left out, and why.

    Of a cyclic table only the entry that changes most is shown: 32 lines a leg hide the rest.
    """
    rows = [_row(name, change) for name, change in _readable(proposal.changes)]
    head = ("parameter", "old", "new", "change", "sigma", "in sigmas", "unit", "")
    lines = [text_table(head, rows)] if rows else ["nothing to change"]
    lines += [f"not written: {name}: {why}" for name, why in proposal.left_out.items()]
    effects = dict.fromkeys(name.split(".")[0] for name in proposal.given_up)
    lines += [f"no longer compensated: {effect}: the fit does not have it" for effect in effects]
    return "\n".join(lines)


def _row(name: str, c: "Change") -> tuple[str, ...]:
    digits = Digits.of(c.sigma, c.old, c.new)
    return (
        name, digits.text(c.old), digits.text(c.new), digits.text(c.new - c.old, signed=True),
        digits.text(c.sigma), fixed(c.in_sigmas, 1, signed=True), c.unit,
        "" if c.identified else "mostly its tolerance",
    )  # fmt: skip


def _readable(changes: "Sequence[Change]") -> "list[tuple[str, Change]]":
    """Every change with its name; of each table the largest, with the number of its entries."""
    tables: dict[str, list[Change]] = {}
    for change in changes:
        if change.old != change.new:
            entry = TABLE_ENTRY.match(change.name)
            tables.setdefault(entry[1] if entry else change.name, []).append(change)
    return [
        (f"{name}, most of {len(those)}" if len(those) > 1 else name, max(those, key=_size))
        for name, those in tables.items()
    ]


def _size(change: "Change") -> float:
    return abs(change.new - change.old)


def _words(applied: "Applied") -> str:
    return (
        f"check poses: peak {applied.before.position_peak_um:.1f} um before, "
        f"{applied.after.position_peak_um:.1f} um after (tracker noise alone: "
        f"{applied.noise_peak_um:.1f} um)\n"
        f"kept as set {applied.kept.number}; the way back: "
        f"pkmcal undo --to {applied.snapshot.number}"
    )
