"""Variations of the kinds of mistakes: other moments, columns, sizes, machines; several at once."""

from collections.abc import Mapping

import numpy as np

from bench.mistakes import joined, labels, motion, readings, units, varied
from bench.mistakes.mistake import THREE, Mistake

_ALL = (*THREE, "hexapod-universal", "delta", "arm")
_TURNING = ("hexapod", "ptm", "hexapod-universal", "arm")
"""Machines that turn their platform: elsewhere an SMR of another size in all nests does nothing."""
_OUT = ("excluded", "many-excluded")
_BACKLASH = {
    "hexapod": {"backlash.leg3": 0.03},
    "tripod": {"backlash.limb1": 0.05},
    "ptm": {"backlash.limb1": 2e-4},
}
_HEAT = {name: {"thermal-growth.a": 3e-5} for name in THREE}
_WEIGHT = {
    "hexapod": {"gravity-sag.c": 3e-4},
    "tripod": {"gravity-sag.c": 1e-3},
    "ptm": {"gravity-sag.c": 6e-9},
}
VARIATIONS: Mapping[str, Mistake] = {
    "base nests renumbered": Mistake(
        varied.base_goes_round(), ("nests-exchanged", "nests-turned"), refused=".", only=_ALL
    ),
    "base nests renumbered from the middle on": Mistake(
        varied.base_goes_round(0.5), ("nests-exchanged", "station-moved", "nest-moved"), only=_ALL
    ),
    "y and z of one platform nest exchanged": Mistake(
        varied.coordinates_exchanged("platform", (1, 2)), ("nest-displaced",), only=_ALL
    ),
    "x and y of one platform nest exchanged": Mistake(
        varied.coordinates_exchanged("platform", (0, 1)), ("nest-displaced",), only=_ALL
    ),
    "y and z of one base nest exchanged": Mistake(
        varied.coordinates_exchanged("base", (1, 2)),
        ("nest-displaced", "nest-table", "nest-moved"),
        only=_ALL,
    ),
    "platform table in the frame of the drawing": Mistake(
        varied.cad_frame("platform"), ("nests-frame", "nests-turned"), only=_ALL
    ),
    "base table in the frame of the drawing": Mistake(
        varied.cad_frame("base"), ("nests-frame", "nests-turned"), only=_ALL
    ),
    "platform table tilted by half a degree": Mistake(
        varied.table_tilted, ("nests-frame", "nests-turned"), only=_ALL
    ),
    "one nest in inches": Mistake(
        varied.nest_in_inches, ("nest-displaced", "nest-unit"), only=_ALL
    ),
    "two numbers of the nest table wrong": Mistake(
        varied.two_nests_wrong, ("nest-displaced", "nest-table"), only=_ALL
    ),
    "a pass in inches": Mistake(varied.pass_in(1 / 25.4), ("points-unit",), only=_ALL),
    "a pass in m": Mistake(varied.pass_in(0.001), ("points-unit",), only=_ALL),
    "tracker moved twice, 0.3 and 0.5 mm": Mistake(
        varied.moved_at((0.3, 0.3), (0.7, 0.5)), ("station-moved",), only=_ALL
    ),
    "tracker moved three times": Mistake(
        varied.moved_at((0.25, 4.0), (0.5, 2.0), (0.75, 6.0)), ("station-moved",), only=_ALL
    ),
    "tracker moved and put back, 5 mm": Mistake(
        varied.moved_and_back(5.0), ("station-moved",), only=_ALL
    ),
    "tracker moved and put back, 0.4 mm": Mistake(
        varied.moved_and_back(0.4), ("station-moved",), only=_ALL
    ),
    "tracker moved 0.1 mm with heat": Mistake(
        motion.moved(0.1, 0.1), ("station-moved",), hidden=_HEAT
    ),
    "tracker moved 2 mm with backlash": Mistake(
        motion.moved(2.0, 2.0), ("station-moved",), hidden=_BACKLASH
    ),
    "tracker moved, 10 poses": Mistake(
        varied.both(varied.first_poses(10), motion.moved(1.0, 5.0)), ("station-moved",), only=_ALL
    ),
    "nests exchanged, 8 poses": Mistake(
        varied.both(varied.first_poses(8), labels.nests_exchanged),
        ("nests-exchanged", "nests-mirrored"),
        only=_ALL,
    ),
    "tracker moved, nests exchanged": Mistake(
        varied.both(motion.moved(5.0, 10.0), labels.nests_exchanged),
        ("station-moved", "nests-exchanged", "nests-mirrored"),
        only=_ALL,
    ),
    "SMR larger in one nest, tracker moved": Mistake(
        varied.both(motion.other_smr(1.0, 3.0), motion.moved(2.0, 5.0)),
        ("station-moved", "smr-size"),
        only=_ALL,
    ),
    "half an inch SMRs everywhere": Mistake(
        varied.smr_everywhere(-12.7), ("nests-frame", "smr-size"), only=_TURNING
    ),
    "two actuators slipped": Mistake(
        varied.slipped_at((0, 0.35, 0.3), (1, 0.7, -0.5)), ("actuator-slipped",), only=_ALL
    ),
    "one actuator slipped twice": Mistake(
        varied.slipped_at((1, 0.35, 0.3), (1, 0.7, 0.4)), ("actuator-slipped",), only=_ALL
    ),
    "an actuator slipped and back": Mistake(
        varied.slipped_at((1, 0.35, 0.5), (1, 0.7, -0.5)), ("actuator-slipped",), only=_ALL
    ),
    "an actuator clamped for a while": Mistake(
        varied.clamped_a_while, ("actuator-clamped", "pose-actuator", *_OUT), only=_ALL
    ),
    "one controller parameter mistyped": Mistake(
        varied.controller_digit, ("controller-parameters",), only=_ALL
    ),
    "q of the next row": Mistake(varied.commands_by(1), ("rows-shifted",), only=_ALL),
    "q of the next row from the middle on": Mistake(
        varied.commands_by(1, 0.5), ("rows-shifted",), only=_ALL
    ),
    "q of the next pose": Mistake(
        varied.commands_of_next_pose, ("rows-shifted",), refused="q", only=_ALL
    ),
    "q three rows late": Mistake(varied.commands_by(-3), ("rows-shifted",), refused="q", only=_ALL),
    "sx and sy exchanged": Mistake(varied.sigmas_exchanged, ("scatter", "sigma-axes"), only=_ALL),
    "sigmas are variances in um2": Mistake(
        varied.variances_um, ("sigma-is-variance", "sigma-in-um"), only=_ALL
    ),
    "sigmas with k = 2": Mistake(varied.sigmas_k2, ("scatter",), only=_ALL),
    "payload in N": Mistake(
        varied.payload(lambda v: np.round(v * 9.80665, 2)),
        ("payload-in-newtons",),
        only=_ALL,
    ),
    "payload in grams, one digit lost": Mistake(
        varied.payload(lambda v: np.round(v * 1000.0 + 0.4, 0)), ("payload-in-grams",), only=_ALL
    ),
    "payload in lb late": Mistake(
        varied.payload(lambda v: v / varied.POUND, 0.7), ("payload-in-lb",), only=_ALL
    ),
    "centre of mass in inches": Mistake(varied.centre_in_inches, ("centre-of-mass-unit",)),
    "temperature in F from the middle": Mistake(
        units.temperature(lambda v: 1.8 * v + 32, part=0.5),
        ("temperature-in-fahrenheit",),
        only=_ALL,
    ),
    "temperature in tenths from a third": Mistake(
        units.temperature(lambda v: np.round(10 * v), part=0.33),
        ("temperature-in-tenths",),
        only=_ALL,
    ),
    "air in kelvin": Mistake(
        units.temperature(lambda v: v + 273.15, "air_temp_C"), ("temperature-in-kelvin",), only=_ALL
    ),
    "kelvin with -127": Mistake(
        varied.both(
            units.temperature(lambda v: v + 273.15),
            varied.column_sentinel("structure_temp_C", -127.0),
        ),
        ("temperature-in-kelvin", "no-temperature"),
        only=_ALL,
    ),
    "temperature 1e30": Mistake(
        varied.column_sentinel("structure_temp_C", 100000000000.0), ("no-temperature",), only=_ALL
    ),
    "temperature -999": Mistake(
        varied.column_sentinel("structure_temp_C", -999.0, 1), ("no-temperature",), only=_ALL
    ),
    "air 85 once": Mistake(
        varied.column_sentinel("air_temp_C", 85.0, 1), ("no-temperature",), only=_ALL
    ),
    "x, y, z are 999 once": Mistake(
        varied.point_sentinel(999.0), ("sentinel-readings", "same-readings"), only=_ALL
    ),
    "x, y, z are -127 once": Mistake(
        varied.point_sentinel(-127.0), ("sentinel-readings", "same-readings"), only=_ALL
    ),
    "x, y, z are -999 twice": Mistake(
        varied.point_sentinel(-999.0, rows=2), ("sentinel-readings", "same-readings"), only=_ALL
    ),
    "x, y, z are 1e11 once": Mistake(
        varied.point_sentinel(100000000000.0), ("sentinel-readings", "same-readings"), only=_ALL
    ),
    "z is 999 four times": Mistake(
        varied.point_sentinel(999.0, (2,), 4), ("sentinel-readings", "same-readings"), only=_ALL
    ),
    "x is 0 once": Mistake(
        varied.point_sentinel(0.0, (0,), 1),
        ("sentinel-readings", "zero-readings", "excluded"),
        only=_ALL,
    ),
    "the clock jumps by an hour": Mistake(varied.time_jumps(3600.0), ("time-jump",), only=_ALL),
    "time in minutes from the middle on": Mistake(varied.late_minutes, ("time-unit",), only=_ALL),
    "fifteen rows once more at the end": Mistake(varied.block_twice, ("rows-twice",), only=_ALL),
    "another session appended": Mistake(
        joined.two_files, ("station-moved", "pose-label-shared"), only=_ALL
    ),
    "a sister's file appended": Mistake(
        joined.two_machines,
        ("station-moved", "pose-label-shared", "several-machines", "geometry-changed"),
        only=("hexapod", "tripod", "ptm", "delta", "arm"),
    ),
    "gravity along x": Mistake(
        units.gravity(lambda g: g[[2, 1, 0]]), ("gravity-direction",), hidden=_WEIGHT
    ),
    "kelvin and nests exchanged": Mistake(
        varied.both(units.temperature(lambda v: v + 273.15), labels.nests_exchanged),
        ("temperature-in-kelvin", "nests-exchanged", "nests-mirrored"),
        only=_ALL,
    ),
    "zeros and tracker moved": Mistake(
        varied.both(readings.zeros_at_the_start, motion.moved(1.0, 5.0)),
        ("zero-readings", "station-moved"),
        only=_ALL,
    ),
    "stale and tracker moved": Mistake(
        varied.both(readings.stale_for_a_while, motion.moved(1.0, 5.0)),
        ("stale-readings", "station-moved"),
        only=_ALL,
    ),
    "y and z of the points exchanged in one pass": Mistake(
        varied.axes_of_a_pass, ("points-axes",), only=_ALL
    ),
}
"""Every one by its name."""
