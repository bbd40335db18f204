"""``[record]`` of a site file: what a calibration record says of people, place and instruments."""

from dataclasses import dataclass, fields
from datetime import date
from pathlib import Path

from calib.toml_table import TomlTable

DATES = ("tracker_calibrated", "reflector_calibrated", "thermometer_calibrated")
"""Days, as 2026-03-14."""
FILES = ("logo", "html_template", "pdf_template")
"""Paths, from the site file's folder."""


@dataclass(frozen=True)
class RecordDetails:
    """Who had what calibrated by whom, and how far off it may be; empty where nobody said."""

    customer: str = ""
    """Who had it calibrated, with the address; lines as in the text."""
    laboratory: str = ""
    """Who calibrated, with the address."""
    place: str = ""
    """Where the machine stands."""
    operator: str = ""
    """Who measured."""
    machine_serial: str = ""
    """Serial number of the machine, where it is not its controller's."""
    machine_maker: str = ""
    tracker_calibrated: str = ""
    """Day of the tracker's own calibration."""
    tracker_certificate: str = ""
    reflector_serial: str = ""
    reflector_calibrated: str = ""
    thermometer: str = ""
    """What measured the temperature of the structure, with its serial number."""
    thermometer_calibrated: str = ""
    procedure: str = ""
    """The laboratory's own procedure, by number."""
    remarks: str = ""
    logo: str = ""
    """SVG or PNG."""
    html_template: str = ""
    pdf_template: str = ""
    tolerance_um: float | None = None
    """Largest position error, norm, that the customer allows."""
    tolerance_mdeg: float | None = None
    """Largest orientation error, rotation angle."""


def record_details(table: TomlTable, folder: Path) -> RecordDetails:
    """Read the table; raises BadInput for dates that are none and files that are not there."""
    texts: dict[str, str] = {}
    tolerances: dict[str, float | None] = {}
    for field in fields(RecordDetails):
        name = field.name
        if name.startswith("tolerance"):
            unit = name.removeprefix("tolerance_")
            tolerances[name] = table.optional_number(name, unit=unit, above=0.0)
            continue
        text = table.text(name, "")
        if text and name in DATES:
            _check_day(table, name, text)
        if text and name in FILES:
            text = str((folder / text).resolve())
            if not Path(text).is_file():
                table.complain(f"no file {text}", name, remedy="Give a path from this file")
        texts[name] = text
    table.end()
    return RecordDetails(**texts, **tolerances)  # type: ignore[arg-type]


def _check_day(table: TomlTable, name: str, text: str) -> None:
    try:
        date.fromisoformat(text)
    except ValueError:
        table.complain(
            f"{name} is {text!r}, no day", name, remedy='Write year-month-day: "2026-03-14"'
        )
