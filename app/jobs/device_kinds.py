"""The kinds of devices that a site file may name, and what each must be told."""

from dataclasses import dataclass
from typing import Any, ClassVar

from app.devices import all_kinds
from app.jobs.record import Record, Report
from calib.errors import BadInput
from drivers.kind import Kind


@dataclass(frozen=True, kw_only=True)
class SettingEntry(Record):
    """What a kind of device is told in the site file; ``default`` None where it is required."""

    name: str
    form: str
    required: bool
    default: Any
    says: str


@dataclass(frozen=True, kw_only=True)
class KindEntry(Record):
    """A kind of controller or tracker; of controllers ``takes`` says what they are sent."""

    role: str
    kind: str
    says: str
    takes: str | None = None
    settings: tuple[SettingEntry, ...]


@dataclass(frozen=True, kw_only=True)
class KindsReport(Report):
    """Kinds of devices, those of installed packages among them (``pkm-kinds/1``)."""

    FORMAT: ClassVar[str] = "pkm-kinds/1"
    kinds: tuple[KindEntry, ...]


def site_kinds(name: str | None = None) -> KindsReport:
    """List the kinds of controllers and trackers that a site file may name.

    Parameters
    ----------
    name : str, optional
        This kind alone.

    Returns
    -------
    KindsReport

    Raises
    ------
    BadInput
        If no kind is called so.

    Examples
    --------
    >>> [one.kind for one in pkmcal.site_kinds().kinds]                      # doctest: +SKIP
    """
    found = [_data(*entry) for entry in kinds_called(name)]
    return KindsReport.of({"format": KindsReport.FORMAT, "kinds": found})


def kinds_called(name: str | None) -> list[tuple[str, str, Kind[Any]]]:
    """Role, name and declaration of every kind, or of those that are called so."""
    found = [(str(role), kind, declared) for role, kind, declared in all_kinds()]
    chosen = [entry for entry in found if name in (None, entry[1])]
    if not chosen:
        raise BadInput(
            f"no kind of device is called {name!r}",
            remedy=f"There are {', '.join(kind for _, kind, _ in found)}",
        )
    return chosen


def _data(role: str, name: str, kind: Kind[Any]) -> dict[str, Any]:
    return {
        "role": role,
        "kind": name,
        "says": kind.says,
        **({"takes": kind.takes} if role == "controller" else {}),
        "settings": [
            {
                "name": one.name,
                "form": one.form,
                "required": one.required,
                "default": None if one.required else one.default,
                "says": one.says,
            }
            for one in kind.settings
        ],
    }
