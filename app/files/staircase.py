"""How a model was found, kept in its file: the staircase, and what could not be told apart."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from calib.toml_table import TomlTable


@dataclass(frozen=True, kw_only=True)
class StairStep:
    """A model on the way; ``did`` is ``start``, ``+ effect`` or ``- effect``.

    RMS in um of fitted readings and of poses that the fit had not seen, each beside its floor;
    ``p_value`` (family-wise) and ``rivals`` (effects that these readings cannot tell from it) as
    they were when it was added; ``weak``: such a p-value may well be chance.
    """

    did: str
    chi2_per_dof: float | None = None
    rms_um: float | None = None
    noise_floor_um: float | None = None
    holdout_rms_um: float | None = None
    holdout_floor_um: float | None = None
    p_value: float | None = None
    weak: bool = False
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True)
class Way:
    """The steps, and the groups of effects between which the readings cannot choose."""

    steps: tuple[StairStep, ...] = ()
    not_told_apart: tuple[tuple[str, ...], ...] = ()


def way_of_discovery(said: Mapping[str, Any]) -> Way:
    """Take the way from the answer of ``pkmcal discover`` (``pkm-discovery/1``)."""
    numbers = ("chi2_per_dof", "rms_um", "noise_floor_um", "holdout_rms_um", "holdout_floor_um")
    steps = [
        StairStep(
            did=_did(step.get("added"), step.get("removed")),
            **{name: step[name] for name in numbers},
            p_value=step.get("p_value"),
            weak=bool(step.get("weak")),
            rivals=tuple(step.get("rivals", ())),
        )
        for step in said["steps"]
    ]
    return Way(tuple(steps), tuple(tuple(group) for group in said["indistinguishable"]))


def _did(added: str | None, removed: str | None) -> str:
    if added:
        return f"+ {added}"
    return f"- {removed}" if removed else "start"


def way_tables(way: Way) -> dict[str, Any]:
    """The way as tables of a model file."""
    steps = [{k: v for k, v in asdict(step).items() if v is not None} for step in way.steps]
    groups = [{"effects": list(group)} for group in way.not_told_apart]
    return {
        **({"staircase": [{**s, "rivals": list(s["rivals"])} for s in steps]} if steps else {}),
        **({"not_told_apart": groups} if groups else {}),
    }


def read_way(top: TomlTable) -> Way:
    """Read these tables; nothing where they are missing."""
    groups = [tuple(table.texts("effects")) for table in top.tables("not_told_apart")]
    return Way(tuple(_steps(top)), tuple(groups))


def _steps(top: TomlTable) -> Sequence[StairStep]:
    return [
        StairStep(
            did=table.text("did"),
            chi2_per_dof=table.optional_number("chi2_per_dof"),
            rms_um=table.optional_number("rms_um", unit="um"),
            noise_floor_um=table.optional_number("noise_floor_um", unit="um"),
            holdout_rms_um=table.optional_number("holdout_rms_um", unit="um"),
            holdout_floor_um=table.optional_number("holdout_floor_um", unit="um"),
            p_value=table.optional_number("p_value"),
            weak=table.flag("weak", False),
            rivals=tuple(table.texts("rivals")),
        )
        for table in top.tables("staircase")
    ]
