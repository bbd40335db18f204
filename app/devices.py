"""Which kinds of devices there are: drivers found by their entry points, the shipped ones too."""

from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal

from calib.errors import BadInput
from drivers.kind import CONTROLLERS, GAUGES, TRACKERS, Kind

Role = Literal["controller", "tracker", "gauge"]
GROUPS: dict[Role, str] = {"controller": CONTROLLERS, "tracker": TRACKERS, "gauge": GAUGES}


@lru_cache(maxsize=3)
def _found(role: Role) -> dict[str, EntryPoint]:
    return {point.name: point for point in sorted(entry_points(group=GROUPS[role]))}


def kind_names(role: Role) -> list[str]:
    """Every kind of a role that an installed package offers.

    Raises
    ------
    BadInput
        If there is none: pkmcal itself was installed before drivers were found this way.
    """
    if not _found(role):
        raise BadInput(
            f"no kind of {role} is installed, not even those that ship",
            place=f"entry points {GROUPS[role]}",
            remedy="Install pkmcal again: pip install -e . in its folder",
        )
    return list(_found(role))


def kind_named(role: Role, name: str) -> Kind[Any]:
    """The kind of a name.

    Raises
    ------
    BadInput
        For a driver that cannot be imported, or that offers something else than a kind.
    """
    point = _found(role)[name]
    where = f"{role} kind {name!r}, {point.value}" + (
        f" of {point.dist.name}" if point.dist else ""
    )
    try:
        kind = point.load()
    except Exception as error:  # whatever a foreign package's import may raise
        raise BadInput(
            f"the driver cannot be imported: {type(error).__name__}: {error}",
            place=where,
            remedy="Install it again, with what it needs",
        ) from error
    if not isinstance(kind, Kind):
        raise BadInput(
            f"the driver offers a {type(kind).__name__}, not a drivers.kind.Kind",
            place=where,
            remedy="Ask its author",
        )
    return kind


def all_kinds() -> Iterator[tuple[Role, str, Kind[Any]]]:
    """Every kind: role, name, declaration."""
    for role in GROUPS:
        for name in kind_names(role):
            yield role, name, kind_named(role, name)
