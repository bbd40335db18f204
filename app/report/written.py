"""What was written to the controller, what was not, and what that costs."""

from collections.abc import Mapping
from typing import Any

from app.history.store import Entry
from app.report.findings import COVERAGE
from app.report.page import Block, Facts, Items, Section, Table, Text
from app.report.words import minute, with_uncertainty
from calib.identify.reach import Reach


def written_section(
    applied: Entry | None, effects: Mapping[str, str], reach: Mapping[str, Reach]
) -> Section:
    """The adjustment; ``effects`` says of each effect in the model what kind it is."""
    if applied is None:
        return Section(
            "Adjustment",
            (Text("Nothing was written to the controller, as far as this record's sources tell."),),
        )
    said, count = applied.said, len(_changed(applied))
    blocks: list[Block] = [
        Facts(
            (
                ("Written", minute(applied.utc)),
                (
                    "Parameter set",
                    f"number {said['set']}, {said['held']} values, of which {count} changed",
                ),
                ("Checksum (CRC-32)", f"{said['checksum']:#010x}"),
                ("Set before", f"number {said['way_back']}, kept"),
                ("Model", str(applied.source)),
                ("Check poses", _checked(said)),
            )
        )
    ]
    costs = [_cost(name, why, effects, reach) for name, why in said["left_out"].items()]
    costs += [f"{name}: no longer compensated; the model does not have it." for name in _ids(said)]
    if costs:
        blocks += [Text("Not written:"), Items(tuple(costs))]
    else:
        blocks.append(Text("All that was found of the machine was written."))
    return Section("Adjustment", tuple(blocks))


def written_values(applied: Entry) -> Section:
    """Every value that changed, before and after."""
    rows = tuple(
        (
            change["name"],
            with_uncertainty(change["old"], COVERAGE * change["sigma"])[0],
            *with_uncertainty(change["new"], COVERAGE * change["sigma"]),
            change["unit"],
        )
        for change in _changed(applied)
    )
    heads = ("parameter", "before", "after", "U (k = 2)", "unit")
    table = Table(heads, rows, "Values that changed, as the controller holds them.", words=(4,))
    return Section("All values written", (table,))


def _changed(applied: Entry) -> list[Mapping[str, Any]]:
    return [change for change in applied.said["parameters"] if change["new"] != change["old"]]


def kept_words(applied: Entry | None, effects: Mapping[str, str]) -> dict[str, str]:
    """What became of each effect: written, left out, or none of the machine."""
    if applied is None:
        return {name: _kind(kind) for name, kind in effects.items()}
    written = {_stem(change["name"].split(".")[0]) for change in applied.said["parameters"]}
    return {
        name: "written" if name in written else _kind(kind, ", not written")
        for name, kind in effects.items()
    }


def _stem(name: str) -> str:
    return name.removesuffix("-table")


def _kind(kind: str, beside: str = "") -> str:
    return f"of the machine{beside}" if kind == "machine" else "of the measurement"


def _ids(said: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(name.split(".")[0] for name in said["given_up"]))


def _cost(name: str, why: str, effects: Mapping[str, str], reach: Mapping[str, Reach]) -> str:
    said = f"{name}: {why.rstrip('.')}"
    if effects.get(name) != "machine" or name not in reach:
        return f"{said}."
    far = reach[name]
    return (
        f"{said}. It moves the nests by {far.rms_um:.1f} µm RMS, at most "
        f"{far.largest_um:.1f} µm, over the measured poses: so much of it stays in the machine."
    )


def _checked(said: Mapping[str, Any]) -> str:
    before, after = said["check_before"], said["check_after"]
    return (
        f"largest position error {before['position_peak_um']:.1f} µm before, "
        f"{after['position_peak_um']:.1f} µm after writing"
    )
