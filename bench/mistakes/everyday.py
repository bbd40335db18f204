"""What operators, spreadsheets and scripts do to a run, each with what is to be said of it."""

from collections.abc import Mapping

from bench.mistakes.mistake import Mistake
from bench.mistakes.spreadsheets import (
    averaged,
    axes_late,
    base_order_turned,
    column_sorted,
    comma_lost,
    cut_at_limit,
    file_with_other_run,
    filled_down,
    labels_a_row_late,
    labels_filled_down,
    minus_lost,
    minus_lost_in_rows,
    never_moved,
    one_axis_in_m,
    one_base_nest_for_all,
    one_column_from_home,
    one_column_in_degrees,
    one_column_in_inches,
    other_session,
    pass_copied,
    sensor_unplugged,
    set_up_anew,
    shuffled,
    sigmas_of_three_axes_mixed,
    sister_base,
    sister_table,
    slid_by,
    smr_throughout,
    sorted_by_nest,
    sorted_by_x,
    spherical,
    stretched,
    temperature_drawn,
    time_of_day,
    turned_axes_late,
    unix_times,
    wrong_lead,
)

_LINEAR = ("hexapod", "tripod", "delta", "stewart")
_TURNING = ("ptm", "arm")
_ALL = (*_LINEAR, *_TURNING)
_OUT = ("excluded", "many-excluded")
EVERYDAY: Mapping[str, Mistake] = {
    "two sessions, the tracker set up anew": Mistake(set_up_anew, ("station-moved",), only=_ALL),
    "x and y exchanged from some reading on": Mistake(axes_late, ("points-axes",), only=_ALL),
    "axes turned from some reading on": Mistake(
        turned_axes_late, ("points-axes", "station-moved"), only=_ALL
    ),
    "one of x, y, z in m": Mistake(one_axis_in_m, refused="look like|looks like", only=_ALL),
    "thousands lost in four values": Mistake(comma_lost, ("points-unit", *_OUT), only=_ALL),
    "minus signs of an axis lost": Mistake(
        minus_lost, ("points-sign",), refused="left-handed|sign", only=_ALL
    ),
    "five values of the wrong sign": Mistake(minus_lost_in_rows, ("points-sign", *_OUT), only=_ALL),
    "x sorted by itself": Mistake(column_sorted, ("column-sorted",), refused="sorted", only=_ALL),
    "eight readings dragged down": Mistake(filled_down, ("filled-down",), only=_ALL),
    "a pass pasted as another's": Mistake(
        pass_copied, ("same-readings", "stale-readings", "rows-twice"), only=_ALL
    ),
    "x, y, z three rows late from a third on": Mistake(
        slid_by(3, 0.33), ("rows-shifted",), only=_ALL
    ),
    "x, y, z two rows late": Mistake(slid_by(2, 0.0), ("rows-shifted",), only=_ALL),
    "q of another session": Mistake(
        other_session, ("pose-label-shared",), refused="are where a nest can be|q", only=_ALL
    ),
    "one column of q from home": Mistake(one_column_from_home, refused="home", only=_LINEAR),
    "one column of q in degrees": Mistake(one_column_in_degrees, refused="degrees", only=_TURNING),
    "one column of q in inches": Mistake(one_column_in_inches, refused="inches", only=_LINEAR),
    "a drive of another lead": Mistake(
        wrong_lead, ("actuator-gain", "geometry-impossible"), only=_ALL
    ),
    "an actuator never moved": Mistake(
        never_moved, ("actuator-clamped",), refused="never|stood", only=_ALL
    ),
    "soft limits cut an actuator": Mistake(
        cut_at_limit, ("actuator-cut", "pose-actuator"), only=_ALL
    ),
    "nest table of the sister machine": Mistake(
        sister_table, ("nest-table", "nest-displaced"), only=_ALL
    ),
    "base table of the sister machine": Mistake(
        sister_base, ("nest-table", "nest-displaced", "nest-moved"), only=_ALL
    ),
    "the SMR stayed in b1 for a visit": Mistake(
        one_base_nest_for_all, ("nests-exchanged", *_OUT, "nest-moved"), only=_ALL
    ),
    "base nests read backwards at the last visit": Mistake(
        base_order_turned, ("nests-exchanged",), only=_ALL
    ),
    "all nests read with a 7/8 inch SMR": Mistake(
        smr_throughout, ("nests-frame", "smr-size"), only=_ALL
    ),
    "x, y, z are angles and distance": Mistake(spherical, refused="angle|spherical", only=_ALL),
    "x, y, z scaled by 1.003": Mistake(
        stretched, ("points-scaled", "geometry-impossible"), refused="scale", only=_ALL
    ),
    "sigmas of one reading for means of nine": Mistake(averaged, ("scatter",), only=_ALL),
    "rows shuffled": Mistake(shuffled, ("rows-sorted",), only=_ALL),
    "rows sorted by nest": Mistake(sorted_by_nest, ("rows-sorted",), only=_ALL),
    "rows sorted by x": Mistake(sorted_by_x, ("rows-sorted",), only=_ALL),
    "a nest label filled down": Mistake(labels_filled_down, ("nests-exchanged", *_OUT), only=_ALL),
    "labels one row late": Mistake(
        labels_a_row_late,
        ("rows-shifted", "pose-label-shared", "nests-exchanged", *_OUT),
        only=_ALL,
    ),
    "the last third is of another machine": Mistake(
        file_with_other_run, ("station-moved", "several-machines"), refused=".", only=_ALL
    ),
    "sx in um alone": Mistake(
        sigmas_of_three_axes_mixed, ("sigma-in-um", "sigma-unit-in-rows"), only=_ALL
    ),
    "a sensor unplugged": Mistake(sensor_unplugged, ("no-temperature",), only=_ALL),
    "temperatures count rows": Mistake(temperature_drawn, ("no-temperature",), only=_ALL),
    "time of day": Mistake(time_of_day, ("time-zero",), only=_ALL),
    "time since 1970": Mistake(unix_times, ("time-zero",), only=_ALL),
}
"""Every one by its name, on six kinds of machines."""
