"""What took the readings of a record, in words: a laser tracker, or whatever a run names."""

from collections.abc import Sequence

import numpy as np

from calib.identify import Fit
from calib.runs.record import Run
from calib.runs.sensing import KINDS


def by_tracker(fit: Fit) -> bool:
    """Whether a laser tracker took readings: runs that name no instruments are a tracker's."""
    return any(run.sensing is None for run in fit.model.rows.runs)


def other_instruments(fit: Fit) -> tuple[str, ...]:
    """Instruments that runs name, with their models, each once."""
    found: dict[str, str] = {}
    for run in fit.model.rows.runs:
        for name, one in run.header.setup.instruments.items() if run.header.setup else ():
            found[name] = f"{name} ({one.model})" if one.model and one.model != name else name
    return tuple(found.values())


def taken_words(fit: Fit) -> list[str]:
    """Who read what, at how many poses: a sentence each."""
    runs = fit.model.rows.runs
    tracked = [run for run in runs if run.sensing is None]
    said = [_of_tracker(tracked)] if tracked else []
    taken: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for run in runs:
        own = run.sensing
        for k in np.flatnonzero(run.measured) if own is not None else ():
            assert own is not None
            who = own.instrument[k], KINDS[own.kind[k]]
            taken.setdefault(who, []).append((run.source, run.pose[k]))
    for (name, kind), places in taken.items():
        read_by = f"The instrument {name}" if name else "An instrument"
        said.append(
            f"{read_by} took {len(places)} readings of the kind {kind} at {len(set(places))} poses."
        )
    return said


def _of_tracker(runs: Sequence[Run]) -> str:
    header = runs[-1].header
    poses = {
        (run.source, run.pose[k])
        for run in runs
        for k in np.flatnonzero(run.measured)
        if run.pose[k]
    }
    return (
        f"A laser tracker measured the centre of a reflector in {len(header.platform_nests)} nests "
        f"of the platform at {len(poses)} poses, and, again and again in between, in "
        f"{len(header.base_nests)} nests of the base, which tie the tracker to the machine."
    )
