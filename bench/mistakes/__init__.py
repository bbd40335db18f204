"""Everyday mistakes put into a clean run: what is done, and what should be said of it."""

import re
from collections.abc import Mapping

import numpy as np

from bench.mistakes import labels, motion, readings, units
from bench.mistakes.clean import machine_named
from bench.mistakes.everyday import EVERYDAY
from bench.mistakes.mistake import Mistake
from bench.mistakes.variations import VARIATIONS
from calib.arrays import Array
from calib.discover.agreement import untrue_uncertainties
from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify.staged import fit_effects
from calib.look import first_look
from calib.look.judged import record_of
from calib.mechanism.description import Machine
from calib.runs.record import Run


def _home(run: Run) -> Array:
    return machine_named(run.header.machine).home_q[:, None]


_LINEAR = ("hexapod", "tripod")
_LABELS = {
    "nests exchanged": Mistake(labels.nests_exchanged, ("nests-exchanged", "nests-mirrored")),
    "nests exchanged from the middle on": Mistake(
        labels.nests_exchanged_late, ("nests-exchanged",)
    ),
    "nests go round": Mistake(labels.nests_rotated, ("nests-exchanged",)),
    "a pass in another hole": Mistake(labels.pass_in_another_hole, ("nests-exchanged",)),
    "half a pass in another hole": Mistake(labels.part_of_a_pass, ("nests-exchanged",)),
    "one reading in another hole": Mistake(labels.one_wrong_hole, ("excluded",)),
    "base nests exchanged": Mistake(labels.base_exchanged, ("nests-exchanged",)),
    "base nests exchanged once": Mistake(
        labels.base_exchanged_once, ("nests-exchanged", "excluded")
    ),
    "nest table mirrored in x": Mistake(labels.mirrored(0), ("nests-mirrored", "nests-exchanged")),
    "nest table mirrored in y": Mistake(labels.mirrored(1), ("nests-mirrored", "nests-exchanged")),
    "nest table, x and y exchanged": Mistake(
        labels.table_axes, ("nests-mirrored", "nests-exchanged", "nests-axes")
    ),
    "nest table turned by 90 deg": Mistake(labels.table_turned, ("nests-turned",)),
    "nest table 25 mm off in z": Mistake(labels.table_off, ("nests-frame", "geometry-impossible")),
    "nest table 10 to 30 mm aside": Mistake(
        labels.table_aside, ("nests-frame", "geometry-impossible")
    ),
    "nest table in m": Mistake(labels.table_scaled(0.001), ("nests-unit",), "nest"),
    "nest table in inches": Mistake(labels.table_scaled(1 / 25.4), ("nests-unit",), "nest"),
    "nest table: one number 2 to 10 mm off": Mistake(
        labels.one_number_wrong, ("nest-displaced", "smr-size")
    ),
    "nest table: one number 0.6 to 2 mm off": Mistake(
        labels.one_number_wrong_by_little, ("nest-displaced",)
    ),
    "nest table: one sign wrong": Mistake(labels.one_sign_wrong, ("nest-displaced",)),
    "base table: one number 1 to 10 mm off": Mistake(
        labels.base_number_wrong, ("nest-displaced", "nest-moved")
    ),
    "a base nest knocked by 0.3 to 2 mm": Mistake(
        labels.base_nest_loose, ("nest-moved", "excluded")
    ),
    "base table mirrored": Mistake(
        labels.base_mirrored, ("nests-mirrored", "nests-exchanged"), "nest"
    ),
    "base table 25 mm off in z": Mistake(
        labels.base_frame_off, ("nests-frame", "geometry-impossible")
    ),
    "base table turned by 90 deg": Mistake(
        labels.base_turned, ("nests-turned", "nests-exchanged"), "nest"
    ),
    "one label for two poses": Mistake(labels.label_shared, ("pose-label-shared",)),
    "labels begin again with 1": Mistake(labels.labels_start_again, ("pose-label-shared",)),
}
_POINTS = {
    "points in m": Mistake(units.points_times(0.001), refused="look like m,"),
    "points in inches": Mistake(units.points_times(1 / 25.4), refused="look like inches"),
    "points in um": Mistake(units.points_times(1000.0), refused="look like um"),
    "points in m from the middle on": Mistake(units.points_late_in_m, ("points-unit",)),
    "x and y of the points exchanged": Mistake(units.points_axes((1, 0, 2)), refused="left-handed"),
    "z of the points has the wrong sign": Mistake(
        units.points_axes((0, 1, 2), (1, 1, -1)), refused="left-handed"
    ),
    "points rounded to 0.1 mm": Mistake(units.points_rounded(0.1), ("points-rounded",)),
    "points rounded to 1 mm": Mistake(units.points_rounded(1.0), ("points-rounded",)),
    "one digit of a point": Mistake(units.one_digit, ("excluded",)),
    "two readings 5 mm off": Mistake(readings.several_strays, ("excluded",)),
    "sigmas in um": Mistake(units.sigmas_times(1000.0), ("sigma-in-um",)),
    "sigmas in m": Mistake(units.sigmas_times(0.001), ("sigma-in-m",)),
    "sigmas are variances": Mistake(units.variances, ("sigma-is-variance",)),
    "three sigmas in um": Mistake(units.some_sigmas_times(1000.0), ("sigma-unit-in-rows",)),
    "three sigmas in m": Mistake(units.some_sigmas_times(0.001), ("sigma-unit-in-rows",)),
    "sigmas in um from the middle on": Mistake(units.late_sigmas_in_um, ("sigma-unit-in-rows",)),
    "sigmas of three standard deviations": Mistake(
        units.sigmas_times(3.0), ("sigma-scale", "scatter")
    ),
    "sigmas a third of the scatter": Mistake(
        units.sigmas_times(1 / 3.0), ("sigma-scale", "scatter")
    ),
}
_COMMANDS = {
    "q in m": Mistake(units.q_times(0.001), refused="look like m", only=_LINEAR),
    "q in inches": Mistake(units.q_times(1 / 25.4), refused="inches", only=_LINEAR),
    "q in degrees": Mistake(units.q_times(180 / np.pi), refused="degrees", only=("ptm",)),
    "q in mrad": Mistake(units.q_times(1000.0), refused="mrad", only=("ptm",)),
    "q from home": Mistake(
        lambda r, c: units.q_from_home(_home)(r, c), refused="from home", only=_LINEAR
    ),
    "q from home, wrong sign": Mistake(
        lambda r, c: units.q_from_home(_home, -1.0)(r, c), refused="home|wrong sign"
    ),
    "one column of q counts the other way": Mistake(units.q_one_sign(_home), refused="sign"),
    "two columns of q exchanged": Mistake(units.q_exchanged, refused="exchange"),
    "columns of q reversed": Mistake(units.q_reversed, refused="revers|exchange"),
    "q rounded to 0.1": Mistake(units.q_rounded(0.1), ("q-rounded",), only=_LINEAR),
    "q rounded to 0.001 rad": Mistake(units.q_rounded(0.001), ("q-rounded",), only=("ptm",)),
    "one column of q stands": Mistake(motion.column_stands, refused="repeats"),
    "q one row late": Mistake(motion.commands_late, ("rows-shifted",)),
    "one q of one pose mistyped": Mistake(motion.mistyped, ("pose-actuator", "excluded")),
    "one q of one row mistyped": Mistake(motion.mistyped_row, ("pose-label-shared", "excluded")),
    "the machine did not go to one pose": Mistake(
        motion.not_gone, ("not-moved", "excluded", "pose-actuator")
    ),
    "an actuator slipped by 20 to 100 um": Mistake(
        motion.slipped(0.02, 0.1), ("actuator-slipped",)
    ),
    "an actuator slipped by 0.2 to 1 mm": Mistake(motion.slipped(0.2, 1.0), ("actuator-slipped",)),
    "an actuator slipped by 2 to 5 mm": Mistake(motion.slipped(2.0, 5.0), ("actuator-slipped",)),
    "an actuator clamped from two thirds on": Mistake(motion.clamped, ("actuator-clamped",)),
    "controller parameters not the stated": Mistake(
        motion.controller_not_stated, ("controller-parameters",), only=("hexapod",)
    ),
}
_CLOCK = {
    "time in ms": Mistake(units.time_times(1000.0), ("time-unit",)),
    "time in minutes": Mistake(units.time_times(1 / 60.0), ("time-unit",)),
    "time in hours": Mistake(units.time_times(1 / 3600.0), ("time-unit",)),
    "all times zero": Mistake(units.time_standing, ("time-stands",)),
    "rows sorted by text": Mistake(readings.sorted_by_text, ("rows-sorted",)),
    "rows sorted by number": Mistake(readings.sorted_by_number, ("rows-sorted",)),
}


def _celsius_to_f(values: Array) -> Array:
    return np.round(1.8 * values + 32.0, 2)


_CHANNELS = {
    "temperature in kelvin": Mistake(
        units.temperature(lambda v: v + 273.15), ("temperature-in-kelvin",)
    ),
    "temperature in kelvin from the middle on": Mistake(
        units.temperature(lambda v: v + 273.15, part=0.5), ("temperature-in-kelvin",)
    ),
    "temperature in Fahrenheit": Mistake(
        units.temperature(_celsius_to_f), ("temperature-in-fahrenheit",)
    ),
    "air in Fahrenheit": Mistake(
        units.temperature(_celsius_to_f, "air_temp_C"), ("temperature-in-fahrenheit",)
    ),
    "temperature in tenths": Mistake(
        units.temperature(lambda v: np.round(10 * v)), ("temperature-in-tenths",)
    ),
    "temperature in hundredths": Mistake(
        units.temperature(lambda v: np.round(100 * v)), ("temperature-in-hundredths",)
    ),
    "temperature in thousandths": Mistake(
        units.temperature(lambda v: np.round(1000 * v)), ("temperature-in-thousandths",)
    ),
    "temperature of the wrong sign": Mistake(
        units.temperature(lambda v: -v), ("temperature-sign", "no-temperature")
    ),
    "three values of -127": Mistake(readings.values_lost((-127.0,) * 3), ("no-temperature",)),
    "85 and 999": Mistake(readings.values_lost((85.0, 999.0)), ("no-temperature",)),
    "two values of 0": Mistake(readings.values_lost((0.0, 0.0)), ("no-temperature",)),
    "temperature always -127": Mistake(readings.sensor_dead(-127.0), ("no-temperature",)),
    "temperature always 0": Mistake(readings.sensor_dead(0.0), ("no-temperature",)),
    "temperature 0 from the middle on": Mistake(
        readings.sensor_dead(0.0, 0.5), ("no-temperature",)
    ),
    "temperature stuck": Mistake(readings.sensor_stuck, ("temperature-stuck",)),
    "temperature stuck for a third": Mistake(readings.sensor_stuck_a_while, ("temperature-stuck",)),
    "temperature jumps by 8 K": Mistake(readings.sensor_jumps, ("temperature-jump",)),
    "one temperature without its point": Mistake(readings.one_value_wrong, ("no-temperature",)),
    "payload in grams": Mistake(units.payload_times(1000.0), ("payload-in-grams",)),
    "payload in grams in the last third": Mistake(
        units.payload_late_in_grams, ("payload-in-grams",)
    ),
    "payload in lb": Mistake(units.payload_times(1 / 0.45359237), ("payload-in-lb",)),
    "payload negative": Mistake(units.payload_times(-1.0), ("payload-negative",)),
    "payload 999": Mistake(units.payload_lost, ("no-payload",)),
    "gravity in g": Mistake(units.gravity(lambda g: g / 9.80665), ("gravity-unit",)),
    "gravity in mm/s2": Mistake(units.gravity(lambda g: 1000 * g), ("gravity-unit",)),
    "gravity is zero": Mistake(units.gravity(lambda g: 0.0 * g), ("gravity-size",)),
    "gravity points up": Mistake(
        units.gravity(lambda g: -g), ("sign-impossible", "gravity-direction")
    ),
    "gravity along y": Mistake(units.gravity(lambda g: g[[0, 2, 1]]), ("gravity-direction",)),
    "centres of mass in m": Mistake(units.centre_in_m, ("centre-of-mass-unit",)),
    "platform's mass in grams": Mistake(units.platform_mass_in_grams, ("mass-in-grams",)),
}
_READINGS = {
    "zeros at the start": Mistake(readings.zeros_at_the_start, ("zero-readings",)),
    "two zeros": Mistake(readings.zeros_here_and_there, ("zero-readings",)),
    "three readings of -1, -1, -1": Mistake(readings.sentinels, ("same-readings",)),
    "z is 0 five times": Mistake(readings.one_axis_zero, ("stale-column", "sentinel-readings")),
    "readings no longer change": Mistake(readings.stale, ("stale-readings",)),
    "six readings repeat": Mistake(readings.stale_for_a_while, ("stale-readings",)),
    "three single readings repeat": Mistake(readings.stale_pairs, ("stale-readings",)),
    "y stands still in the last quarter": Mistake(readings.stale_axis, ("stale-column",)),
    "each row twice": Mistake(readings.each_row_twice, ("rows-twice",)),
    "the whole file twice": Mistake(readings.file_twice, ("rows-twice",)),
    "ten rows twice": Mistake(readings.some_rows_twice, ("rows-twice",)),
    "x, y, z one row late": Mistake(readings.rows_off_by_one, ("rows-shifted", "stale-readings")),
    "x, y, z one row late from the middle on": Mistake(
        readings.rows_off_late, ("rows-shifted", "stale-readings")
    ),
}
_STATION = {
    "tracker moved by 20 to 50 mm": Mistake(motion.moved(20.0, 50.0), ("station-moved",)),
    "tracker moved by 1 to 5 mm": Mistake(motion.moved(1.0, 5.0), ("station-moved",)),
    "tracker moved by 0.2 to 1 mm": Mistake(motion.moved(0.2, 1.0), ("station-moved",)),
    "tracker moved by 0.05 to 0.2 mm": Mistake(
        motion.moved(0.05, 0.2), ("station-moved", "frame-shift")
    ),
    "tracker moved by 10 mm after 95 %": Mistake(
        motion.moved(10.0, 10.0, 0.94, 0.95), ("station-moved",)
    ),
    "tracker moved by 10 mm after 5 %": Mistake(
        motion.moved(10.0, 10.0, 0.05, 0.06), ("station-moved",)
    ),
    "tracker moved, base nests read at the start alone": Mistake(
        motion.moved_unseen, ("station-moved",)
    ),
    "tracker moved twice": Mistake(motion.moved_twice, ("station-moved",)),
    "tracker turned by 1 mrad": Mistake(motion.turned, ("station-moved",)),
    "SMR 0.5 to 3 mm larger in one nest": Mistake(motion.other_smr(0.5, 3.0), ("smr-size",)),
    "SMR 5 to 8 mm larger in one nest": Mistake(motion.other_smr(5.0, 8.0), ("smr-size",)),
    "SMR 0.5 to 3 mm larger in one nest from its middle on": Mistake(
        motion.other_smr(0.5, 3.0, 0.5), ("smr-size",)
    ),
    "SMR 5 to 8 mm larger in one nest from its middle on": Mistake(
        motion.other_smr(5.0, 8.0, 0.5), ("smr-size",)
    ),
    "another SMR from the middle on": Mistake(
        motion.other_smr_everywhere, ("smr-size", "station-moved")
    ),
    "another SMR on the platform throughout": Mistake(
        motion.other_smr_throughout, ("nests-frame",)
    ),
    "another reflector once": Mistake(motion.other_reflector_once, ("excluded",)),
    "another reflector from the middle on": Mistake(motion.range_off, ("range-step",)),
}
MISTAKES: Mapping[str, Mistake] = {
    **_LABELS, **_POINTS, **_COMMANDS, **_CLOCK, **_CHANNELS, **_READINGS, **_STATION,
    **EVERYDAY, **VARIATIONS,
}  # fmt: skip
"""Every mistake by its name."""
WRONG = ("silent", "wrong", "refused in other words", "named among others")


def said_of(mistake: Mistake, machine: Machine, run: Run) -> tuple[str, str]:
    """Judge what a fit of the run says first: ``named``, ``refused``, ``seen`` or one of WRONG.

    ``seen``: without a remark, by what an answer holds anyway (single readings excluded, the
    scatter against the stated sigmas). Beside it what was said.
    """
    try:
        rows = first_look(machine, [run])
        fitted = fit_effects(rows, [effect_named(name, machine) for name in rows.known])
    except BadInput as error:
        right = bool(mistake.refused) and re.search(mistake.refused, str(error)) is not None
        return ("refused" if right else "refused in other words"), str(error)
    record = record_of(fitted)
    words = " | ".join(f"{one.name}: {one.says}" for one in record)
    names = {one.name for one in record}
    if names:
        right = names & set(mistake.says)
        if not right:
            return "wrong", words
        return ("named" if names <= set(mistake.says) else "named among others"), words
    seen = {"excluded"} if 0 < len(fitted.bad) <= 3 else set()
    seen |= {"scatter"} if untrue_uncertainties(fitted) else set()
    return ("seen" if seen & set(mistake.says) else "silent"), words
