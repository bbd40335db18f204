"""What operators, spreadsheets and scripts do to a run: pasted, sorted, filled down, mixed up."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from bench.mistakes.clean import (
    base_frame,
    clean_run,
    from_part,
    in_order,
    machine_named,
    moved_actuators,
    on_platform,
    platform_turns,
    read_rows,
    with_header,
)
from bench.mistakes.mistake import Chance, Make
from calib.frames import Frame
from calib.runs.record import Run


def _at(run: Run, position: np.ndarray) -> Run:
    return replace(run, position=position)


def set_up_anew(run: Run, chance: Chance) -> Run:
    """Two sessions in one file: the tracker stood elsewhere in the second, a metre and 40 deg."""
    frame = Frame.of([*(chance.normal(size=3) * 600.0), 0.02, -0.03, float(chance.uniform(-1, 1))])
    which = from_part(run, chance.uniform(0.3, 0.7))
    position = run.position.copy()
    position[:, which] = frame.apply(position[:, which])
    return _at(run, position)


def axes_late(run: Run, chance: Chance) -> Run:
    """From some reading on the axes are exported as y, x, z."""
    which = from_part(run, chance.uniform(0.3, 0.7))
    return _at(run, np.where(which, run.position[[1, 0, 2]], run.position))


def turned_axes_late(run: Run, chance: Chance) -> Run:
    """From some reading on the axes are exported as z, x, y: right-handed still."""
    which = from_part(run, chance.uniform(0.3, 0.7))
    return _at(run, np.where(which, run.position[[2, 0, 1]], run.position))


def one_axis_in_m(run: Run, chance: Chance) -> Run:
    """One of x, y, z is in metres."""
    position = run.position.copy()
    position[int(chance.integers(3))] *= 0.001
    return _at(run, position)


def comma_lost(run: Run, chance: Chance) -> Run:
    """Values of one axis lost their thousands: 1,234.567 became 1.234567 in four rows."""
    position = run.position.copy()
    axis = int(np.argmax(np.abs(np.nanmedian(position, axis=1))))
    position[axis, chance.choice(read_rows(run), 4, replace=False)] *= 0.001
    return _at(run, position)


def minus_lost(run: Run, chance: Chance) -> Run:
    """The minus signs of one axis are gone."""
    negative = np.nanmean(run.position < 0.0, axis=1)
    axis = int(np.argmax(negative))
    position = run.position.copy()
    position[axis] = np.abs(position[axis])
    return _at(run, position)


def minus_lost_in_rows(run: Run, chance: Chance) -> Run:
    """Five values of one axis lost their minus sign, or got one."""
    position = run.position.copy()
    rows = chance.choice(read_rows(run), 5, replace=False)
    position[int(chance.integers(3)), rows] *= -1.0
    return _at(run, position)


def column_sorted(run: Run, chance: Chance) -> Run:
    """X was sorted by itself in a spreadsheet, the other columns were not."""
    position, read = run.position.copy(), read_rows(run)
    position[0, read] = np.sort(position[0, read])
    return _at(run, position)


def filled_down(run: Run, chance: Chance) -> Run:
    """Eight readings were made by dragging two cells down: each a constant step on."""
    read, position = read_rows(run), run.position.copy()
    first = int(chance.integers(4, read.size - 12))
    step = position[:, read[first]] - position[:, read[first - 1]]
    for k in range(1, 9):
        position[:, read[first + k]] = position[:, read[first]] + k * step
    return _at(run, np.round(position, 6))


def pass_copied(run: Run, chance: Chance) -> Run:
    """Readings of the second nest are those of the first, pasted once more."""
    names = [n for n in run.header.platform_nests if n in run.nest][:2]
    first = {run.pose[k]: k for k in read_rows(run) if run.nest[k] == names[0]}
    position = run.position.copy()
    for k in read_rows(run):
        if run.nest[k] == names[1] and run.pose[k] in first:
            position[:, k] = position[:, first[run.pose[k]]]
    return _at(run, position)


def slid_by(count: int, part: float) -> Make:
    """From a part of the run on x, y, z stand ``count`` readings too late."""

    def make(run: Run, chance: Chance) -> Run:
        read = read_rows(run)[int(part * read_rows(run).size) :]
        position = run.position.copy()
        position[:, read[count:]] = position[:, read[:-count]]
        return _at(run, position)

    return make


def other_session(run: Run, chance: Chance) -> Run:
    """The columns q are those of another session with as many rows."""
    machine = run.header.machine
    other = clean_run(machine, int(chance.integers(1000)), poses=32)
    q = other.q[:, np.arange(run.line.size) % other.line.size]
    return replace(run, q=q)


def one_column_from_home(run: Run, chance: Chance) -> Run:
    """One column of q counts from home, the others do not."""
    q, home = run.q.copy(), machine_named(run.header.machine).home_q
    k = int(chance.integers(q.shape[0]))
    q[k] -= home[k]
    return replace(run, q=q)


def one_column_in_degrees(run: Run, chance: Chance) -> Run:
    """One column of q is in degrees."""
    q = run.q.copy()
    q[int(chance.integers(q.shape[0]))] *= 180.0 / np.pi
    return replace(run, q=q)


def one_column_in_inches(run: Run, chance: Chance) -> Run:
    """One column of q is in inches."""
    q = run.q.copy()
    q[int(chance.integers(q.shape[0]))] /= 25.4
    return replace(run, q=q)


def wrong_lead(run: Run, chance: Chance) -> Run:
    """A drive is set to another lead: 5 mm for 5.08, so one actuator goes 1.6 % farther."""
    change = np.zeros_like(run.q)
    k = int(chance.integers(run.q.shape[0]))
    change[k] = 0.016 * (run.q[k] - machine_named(run.header.machine).home_q[k])
    return moved_actuators(run, machine_named(run.header.machine), change)


def never_moved(run: Run, chance: Chance) -> Run:
    """One actuator was disabled: it stood at home throughout, whatever was commanded."""
    change = np.zeros_like(run.q)
    k = int(chance.integers(run.q.shape[0]))
    change[k] = machine_named(run.header.machine).home_q[k] - run.q[k]
    return moved_actuators(run, machine_named(run.header.machine), change)


def cut_at_limit(run: Run, chance: Chance) -> Run:
    """Soft limits cut one actuator: what was commanded beyond is not reached."""
    k, change = int(chance.integers(run.q.shape[0])), np.zeros_like(run.q)
    most = np.quantile(run.q[k], 0.88)
    change[k] = np.minimum(run.q[k], most) - run.q[k]
    return moved_actuators(run, machine_named(run.header.machine), change)


def sister_table(run: Run, chance: Chance) -> Run:
    """The nest table is that of the sister machine: each nest some tenths of a mm elsewhere."""
    table = {
        name: nest + chance.normal(size=3) * 0.4 for name, nest in run.header.platform_nests.items()
    }
    return with_header(run, platform_nests=table)


def sister_base(run: Run, chance: Chance) -> Run:
    """The same of the base."""
    table = {
        name: nest + chance.normal(size=3) * 0.4 for name, nest in run.header.base_nests.items()
    }
    return with_header(run, base_nests=table)


def one_base_nest_for_all(run: Run, chance: Chance) -> Run:
    """At the second visit the SMR stayed in b1 while b2, b3, b4 were written."""
    base = [k for k in read_rows(run) if run.nest[k] in run.header.base_nests]
    visit = base[len(run.header.base_nests) : 2 * len(run.header.base_nests)]
    position = run.position.copy()
    for k in visit[1:]:
        position[:, k] = position[:, visit[0]] + 0.005 * chance.normal(size=3)
    return _at(run, position)


def base_order_turned(run: Run, chance: Chance) -> Run:
    """At the last visit the base nests were read in reversed order."""
    base = [k for k in read_rows(run) if run.nest[k] in run.header.base_nests]
    last = base[-len(run.header.base_nests) :]
    position = run.position.copy()
    position[:, last] = run.position[:, last[::-1]]
    return _at(run, position)


def smr_throughout(run: Run, chance: Chance) -> Run:
    """All nests, base ones too, were read with a 7/8 inch SMR, the tables are for 1.5 inch."""
    turns = platform_turns(run, machine_named(run.header.machine))
    upright = np.where(on_platform(run), turns[:, 2, :], base_frame(run)[0][:, [2]])
    return _at(run, run.position - 7.9375 * upright)


def spherical(run: Run, chance: Chance) -> Run:
    """X, y, z hold horizontal angle, vertical angle (deg) and distance."""
    x, y, z = run.position
    far = np.sqrt(x**2 + y**2 + z**2)
    told = np.stack([np.degrees(np.arctan2(y, x)), np.degrees(np.arccos(z / far)), far])
    return _at(run, told)


def stretched(run: Run, chance: Chance) -> Run:
    """Fitted to nominal points with a scale of its own: all lengths are 0.3 % longer."""
    return _at(run, 1.003 * run.position)


def averaged(run: Run, chance: Chance) -> Run:
    """Readings were rounded off by averaging: sigmas are those of one, the scatter a third."""
    return replace(run, covariance=9.0 * run.covariance)


def shuffled(run: Run, chance: Chance) -> Run:
    """The rows were shuffled, and times written anew."""
    return in_order(run, chance.permutation(run.line.size))


def sorted_by_nest(run: Run, chance: Chance) -> Run:
    """The rows are sorted by nest, then pose; times written anew."""
    return in_order(
        run, sorted(range(run.line.size), key=lambda k: (run.nest[k], run.pose[k].zfill(4)))
    )


def sorted_by_x(run: Run, chance: Chance) -> Run:
    """The rows are sorted by x, times written anew."""
    return in_order(run, np.argsort(np.nan_to_num(run.position[0], nan=-1e9), kind="stable"))


def labels_filled_down(run: Run, chance: Chance) -> Run:
    """The column nest was filled down: twelve rows bear the label of the first of them."""
    rows = np.flatnonzero(on_platform(run))
    other = np.flatnonzero([run.nest[a] != run.nest[b] for a, b in pairwise(rows)])
    first = int(other[other.size // 2])
    nest = list(run.nest)
    for k in rows[max(0, first - 3) : first + 10]:
        nest[k] = nest[rows[max(0, first - 3)]]
    return replace(run, nest=tuple(nest))


def labels_a_row_late(run: Run, chance: Chance) -> Run:
    """The labels of pose and nest stand one row too late."""
    read = read_rows(run)
    pose, nest = list(run.pose), list(run.nest)
    for k, before in zip(read[1:], read[:-1], strict=True):
        pose[k], nest[k] = run.pose[before], run.nest[before]
    return replace(run, pose=tuple(pose), nest=tuple(nest))


def file_with_other_run(run: Run, chance: Chance) -> Run:
    """The last third is of another machine of the kind, with the same poses."""
    other = clean_run(run.header.machine, 70_000 + int(chance.integers(1000)), poses=32)
    size = min(run.line.size, other.line.size)
    late = np.arange(run.line.size) >= 2 * size // 3
    late[size:] = False
    position = run.position.copy()
    position[:, late] = other.position[:, : run.line.size][:, late[: other.line.size]]
    return _at(run, position)


def sigmas_of_three_axes_mixed(run: Run, chance: Chance) -> Run:
    """Sx in um, sy and sz in mm."""
    scale = np.diag([1000.0, 1.0, 1.0])
    return replace(run, covariance=np.einsum("ij,jkn,lk->iln", scale, run.covariance, scale))


def sensor_unplugged(run: Run, chance: Chance) -> Run:
    """From the middle on the sensor reads what an open line gives: 3276.7."""
    values = run.channels["structure_temp_C"].copy()
    values[values.size // 2 :] = 3276.7
    return replace(run, channels={**run.channels, "structure_temp_C": values})


def temperature_drawn(run: Run, chance: Chance) -> Run:
    """The column of temperatures holds the number of the row."""
    values = np.arange(run.line.size, dtype=np.float64)
    return replace(run, channels={**run.channels, "structure_temp_C": values})


def time_of_day(run: Run, chance: Chance) -> Run:
    """time_s is the time of day."""
    return replace(run, time_s=37_000.0 + run.time_s)


def unix_times(run: Run, chance: Chance) -> Run:
    """time_s is in seconds since 1970."""
    return replace(run, time_s=1.79e9 + run.time_s)
