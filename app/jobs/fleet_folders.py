"""The runs of a fleet in their folders: what can be read, what cannot, and what is no run."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from app.files.runs import HEADER, LoadedRun, read_run
from app.jobs.chosen_runs import Runs, names_of
from calib.errors import BadInput


@dataclass(frozen=True, eq=False)
class Place:
    """A folder with a run: the run, or why it is left out."""

    folder: Path
    run: LoadedRun | None
    failed: str = ""


def places_of(folders: Runs, kept_in: Path | None = None) -> tuple[list[Place], list[Path]]:
    """The runs of a fleet, sorted by their folders, and folders among them in which none lies.

    A run that cannot be read, or is of another type of machine than most, is left out with the
    reason. ``kept_in`` is where answers are kept.

    Raises
    ------
    BadInput
        For a folder that is not there or holds no run, fewer than two machines of one type, and
        where no type has more machines than any other.
    """
    found, empty = _folders(folders, kept_in)
    places = _of_one_type([_read(folder) for folder in found])
    if len(places) == 1:
        raise BadInput("one machine is no fleet", remedy="Name the runs of two machines at least")
    if sum(one.run is not None for one in places) < 2:
        why = next(one.failed for one in places if one.failed)
        raise BadInput(f"fewer than two machines can be fitted: {why}", remedy="Correct their runs")
    return places, empty


def _folders(folders: Runs, kept_in: Path | None) -> tuple[list[Path], list[Path]]:
    """Folders of runs, and folders beside them without one."""
    found: dict[Path, None] = {}
    empty: list[Path] = []
    for name in names_of(folders):
        folder = Path(name)
        if not folder.is_dir():
            raise BadInput("no such folder", place=name, remedy="Name runs, or folders of runs")
        if (folder / HEADER).is_file():
            found[folder.resolve()] = None
            continue
        below = sorted(one for one in folder.iterdir() if one.is_dir())
        runs = [one for one in below if (one / HEADER).is_file()]
        if not runs:
            raise BadInput("no run lies in it", place=name, remedy="Name runs, or folders of runs")
        found |= dict.fromkeys(one.resolve() for one in runs)
        answers = None if kept_in is None else kept_in.resolve()
        empty += [
            one
            for one in below
            if one not in runs and not one.name.startswith(".") and one.resolve() != answers
        ]
    return list(found), empty


def _read(folder: Path) -> Place:
    try:
        return Place(folder, read_run(folder))
    except BadInput as wrong:
        return Place(folder, None, str(wrong))


def _of_one_type(places: Sequence[Place]) -> list[Place]:
    """The same with only the type that most machines are of."""
    types: list[list[LoadedRun]] = []
    for place in places:
        if place.run is not None:
            own = [one for one in types if _alike(one[0], place.run)]
            if own:
                own[0].append(place.run)
            else:
                types.append([place.run])
    types.sort(key=len, reverse=True)
    if len(types) > 1 and len(types[0]) == len(types[1]):
        one, other = types[0][0], types[1][0]
        raise BadInput(
            f"{_differs(other, one)}, and there are as many of both",
            place=str(other.folder / HEADER),
            remedy="Fit machines of one type together",
        )
    left = {run.folder for others in types[1:] for run in others}
    return [
        Place(one.folder, None, _differs(one.run, types[0][0]))
        if one.run is not None and one.run.folder in left
        else one
        for one in places
    ]


def _alike(one: LoadedRun, other: LoadedRun) -> bool:
    return one.machine.parameters == other.machine.parameters


def _differs(one: LoadedRun, other: LoadedRun) -> str:
    """How a machine is not of the type of another."""
    if one.machine.name != other.machine.name:
        return f"a {one.machine.name}, but {other.folder} is of a {other.machine.name}"
    own, theirs = ({p.name: p for p in run.machine.parameters} for run in (one, other))
    name = next(name for name in {**own, **theirs} if own.get(name) != theirs.get(name))
    return f"its machine file has another {name} than that of {other.folder}"
