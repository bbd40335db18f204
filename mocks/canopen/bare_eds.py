"""EDS files of the drives of a bare machine, as their maker would write them.

``python -m mocks.canopen.bare_eds`` writes them into this folder. The drives count increments of
the motor's encoder; RPDO 1 holds more than the controlword, RPDO 2 to 4 are free to be mapped.
"""

import dataclasses
from pathlib import Path

from mocks.canopen.eds_text import (
    Entry,
    Object,
    array,
    communication_objects,
    eds_text,
    record,
    variable,
)
from mocks.canopen.make_eds import DriveUnits, drive_objects

FOLDER = Path(__file__).resolve().parent
PRODUCT, PRODUCT_CODE = "pkmcal mock servo", 0xBA5E
INCREMENTS = 1 << 20
"""Of the encoder, a revolution of the motor."""


@dataclasses.dataclass(frozen=True)
class Gearing:
    """Motor to actuator: revolutions of the motor for one of the shaft, and 0x6092.

    ``feed`` a revolution of the shaft in thousandths of a mm, or millionths of a rad; ``unit``
    is that thousandth or millionth in the actuator's unit.
    """

    gear: int
    feed: int
    unit: float

    @property
    def counts(self) -> float:
        """Increments in one mm or rad."""
        return INCREMENTS * self.gear / (self.feed * self.unit)


SCREW, TABLE = Gearing(1, 5000, 1e-3), Gearing(90, 6_283_185, 1e-6)


def gearing_of(unit: str) -> Gearing:
    """Return what stands between motor and an actuator in ``unit``."""
    return TABLE if unit == "rad" else SCREW


def _units(unit: str) -> DriveUnits:
    counts = gearing_of(unit).counts
    speed, window = (0.2, 3e-4) if unit == "rad" else (20.0, 0.1)
    return DriveUnits(
        "inc", 0, round(window * counts), round(speed * counts), round(5 * speed * counts),
        -(2**31), 2**31 - 1,
    )  # fmt: skip


def _receive_pdo(number: int, off: bool, kind: int, mapped: list[int]) -> list[Object]:
    """An RPDO that can be mapped anew: four places, of which the first are used."""
    cob_id = "$NODEID+0x80000{}00" if off else "$NODEID+0x{}00"
    communication = [
        Entry("COB-ID", "U32", "rw", cob_id.format(number + 1)),
        Entry("Transmission type", "U8", "rw", kind),
    ]
    places = [*mapped, *([0] * (4 - len(mapped)))]
    mapping = [Entry(f"Mapped object {n}", "U32", "rw", w) for n, w in enumerate(places, start=1)]
    return [
        record(0x1400 + number - 1, f"RPDO {number} communication parameter", communication),
        array(0x1600 + number - 1, f"RPDO {number} mapping parameter", mapping, len(mapped)),
    ]


def bare_objects(unit: str) -> list[Object]:
    """Return the dictionary of a drive that moves an actuator in ``unit``."""
    gearing, units = gearing_of(unit), _units(unit)
    named = communication_objects(PRODUCT, PRODUCT_CODE, 0x0002_0192, 1)
    kept = [
        obj
        for obj in drive_objects(units)
        if obj.index not in (0x60A8, 0x1400, 0x1600) and obj.index not in {n.index for n in named}
    ]
    window = next(obj for obj in kept if obj.index == 0x6067)
    kept.remove(window)
    return [
        *(obj for obj in named if obj.index not in (0x1010, 0x1011)),
        *kept,
        variable(0x1005, Entry("COB-ID SYNC message", "U32", "rw", 0x80)),
        variable(0x1006, Entry("Communication cycle period", "U32", "rw", 0, "us")),
        variable(
            0x6067, Entry("Position window", "U32", "rw", round(gearing.counts * 1e-4), "inc")
        ),
        variable(0x2010, Entry("Reference status", "U16", "ro", 0, "", True)),
        array(
            0x608F,
            "Position encoder resolution",
            [
                Entry("Encoder increments", "U32", "ro", INCREMENTS),
                Entry("Motor revolutions", "U32", "ro", 1),
            ],
        ),
        array(
            0x6091,
            "Gear ratio",
            [
                Entry("Motor revolutions", "U32", "ro", gearing.gear),
                Entry("Shaft revolutions", "U32", "ro", 1),
            ],
        ),
        array(
            0x6092,
            "Feed constant",
            [
                Entry("Feed", "U32", "ro", gearing.feed),
                Entry("Shaft revolutions", "U32", "ro", 1),
            ],
        ),
        record(
            0x60C2,
            "Interpolation time period",
            [
                Entry("Interpolation time period value", "U8", "rw", 10),
                Entry("Interpolation time index", "I8", "rw", -3),
            ],
        ),
        *_receive_pdo(1, False, 255, [0x6040_0010, 0x6060_0008, 0x607A_0020]),
        *(obj for n in (2, 3, 4) for obj in _receive_pdo(n, True, 255, [])),
    ]


def bare_eds_path(unit: str) -> Path:
    """Return the EDS file of drives that move actuators in ``unit``."""
    return FOLDER / ("bare_table.eds" if unit == "rad" else "bare_screw.eds")


def shipped_bare_eds() -> list[tuple[Path, str]]:
    """Return paths and texts of the EDS files of bare drives."""
    names = (("bare_screw.eds", "mm"), ("bare_table.eds", "rad"))
    return [
        (FOLDER / name, eds_text(name, PRODUCT, PRODUCT_CODE, bare_objects(unit)))
        for name, unit in names
    ]


def main() -> None:
    """Write the EDS files."""
    for path, text in shipped_bare_eds():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
