"""Runs from the disk, effects by name, readings stacked: what every analysis begins with."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.files.models import chosen_effects, offered_effects
from app.files.runs import LoadedRun, read_runs
from calib.effects import Effect, catalogue, effect_named
from calib.effects.of_one_run import each_alone
from calib.errors import BadInput
from calib.look import first_look
from calib.runs.stack import Rows, stack

if TYPE_CHECKING:
    from calib.discover.discovery import Refitter


def load_rows(
    runs: tuple[str, ...], add: tuple[str, ...] = (), model: Path | None = None
) -> tuple[Rows, list[Effect]]:
    """Read runs as they are meant, and find the effects of the model.

    These are the ones asked for and those that the record itself shows. Raises BadInput with the
    place.
    """
    loaded = read_runs(runs)
    return looked_at(loaded, chosen_effects(loaded[0].machine, add, model))


def looked_at(loaded: Sequence[LoadedRun], effects: Sequence[Effect]) -> tuple[Rows, list[Effect]]:
    """The readings as they are meant; with effects those that the record itself shows."""
    machine = loaded[0].machine
    rows = first_look(machine, [one.run for one in loaded])
    asked = {effect.id for effect in effects}
    shown = [effect_named(name, machine) for name in rows.known if name not in asked]
    return rows, [*effects, *shown]


def read_rows(runs: tuple[str, ...]) -> Rows:
    """Read runs as they stand in their files; raises BadInput with the place."""
    loaded = read_runs(runs)
    return stack(loaded[0].machine, [one.run for one in loaded])


def masked_rows(rows: Rows, lines: Sequence[str]) -> tuple[int, ...]:
    """Readings (indices into ``rows``) that the operator masks, by their lines.

    A line is ``118``, or of several runs ``run:118`` with the run's folder.

    Raises
    ------
    BadInput
        Where no reading stands in such a line.
    """
    found: list[int] = []
    for text in lines:
        folder, _, line = text.rpartition(":")
        if not line.isdigit() or (not folder and len(rows.runs) > 1):
            remedy = "Write RUN:LINE" if len(rows.runs) > 1 else "Write the number of a line"
            raise BadInput(f"--mask {text} names no line of points.csv", remedy=remedy)
        numbers = [
            number
            for number, run in enumerate(rows.runs)
            if not folder or Path(run.source).parent == Path(folder)
        ]
        here = np.isin(rows.run, numbers) & (rows.line == int(line))
        if not here.any():
            raise BadInput(
                f"no reading stands in line {line}",
                place=folder or rows.runs[0].source,
                remedy="Lines count from 1, the header's",
            )
        found += [int(row) for row in np.flatnonzero(here)]
    return tuple(found)


def load_refitter(
    runs: tuple[str, ...],
    add: tuple[str, ...] = (),
    model: Path | None = None,
    watch: Callable[[tuple[str, ...]], None] | None = None,
    offer: Sequence[Path] = (),
    mask: Sequence[str] = (),
    each_run: bool = False,
) -> "tuple[Refitter, tuple[str, ...]]":
    """Make runs ready for diagnosis: a refitter over the catalogue, and the effects to begin with.

    ``offer`` are effect files that are candidates beside the catalogue; ``watch`` is told the
    effects of every model that is looked at; ``mask`` are lines as :func:`masked_rows` takes them.
    ``each_run``: machine effects are candidates for each run alone as well.
    """
    from calib.discover.discovery import Refitter  # a fit goes without

    rows, effects = load_rows(runs, add, model)
    shared = catalogue(rows.machine)
    alone = each_alone(shared, rows) if each_run else ()
    candidates = (*shared, *alone, *offered_effects(offer, effects), *effects)
    known = {effect.id: effect for effect in candidates}
    masked = masked_rows(rows, mask)
    refit = Refitter(rows, tuple(known.values()), masked=masked, watch=watch)
    return refit, tuple(effect.id for effect in effects)


def asked_for(refit: "Refitter", begin: tuple[str, ...], add: Sequence[str]) -> tuple[str, ...]:
    """Effects to begin a discovery with: those that the record shows are steps of their own."""
    return tuple(name for name in begin if name not in refit.rows.known or name in add)
