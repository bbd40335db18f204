"""Variations: other moments, columns and sizes, and two things at once."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.mistakes.clean import (
    base_frame,
    from_part,
    in_order,
    machine_named,
    moved_actuators,
    moved_by,
    on_platform,
    platform_turns,
    read_nests,
    read_rows,
    with_channel,
    with_header,
)
from bench.mistakes.mistake import Chance, Make
from calib.frames import Frame
from calib.runs.record import Run

POUND = 0.45359237


def both(*makes: Make) -> Make:
    """Several mistakes, one after the other."""

    def make(run: Run, chance: Chance) -> Run:
        for one in makes:
            run = one(run, chance)
        return run

    return make


def base_goes_round(part: float = 0.0) -> Make:
    """The nests of the base are numbered from another one on, from a part of the run on."""

    def make(run: Run, chance: Chance) -> Run:
        names = list(run.header.base_nests)
        other = dict(zip(names, names[1:] + names[:1], strict=True))
        late = from_part(run, part)
        return replace(
            run,
            nest=tuple(
                other.get(n, n) if row else n for n, row in zip(run.nest, late, strict=True)
            ),
        )

    return make


def coordinates_exchanged(table: str, axes: tuple[int, int]) -> Make:
    """Two coordinates of one nest are exchanged in the table."""

    def make(run: Run, chance: Chance) -> Run:
        nests = run.header.platform_nests if table == "platform" else run.header.base_nests
        names = [n for n in nests if n in run.nest and abs(np.diff(nests[n][list(axes)])[0]) > 1.0]
        name = str(chance.choice(names))
        at = nests[name].copy()
        at[list(axes)] = at[list(axes[::-1])]
        return with_header(run, **{f"{table}_nests": {**nests, name: at}})

    return make


def cad_frame(table: str) -> Make:
    """The table is in the frame of the drawing: another origin, turned about z by 30 deg or so."""

    def make(run: Run, chance: Chance) -> Run:
        nests = run.header.platform_nests if table == "platform" else run.header.base_nests
        angle = float(chance.choice([-1.0, 1.0]) * chance.uniform(0.3, 1.2))
        frame = Frame.of([*(chance.normal(size=3) * 200.0), 0.0, 0.0, angle])
        moved = {name: frame.apply(at[:, None])[:, 0] for name, at in nests.items()}
        return with_header(run, **{f"{table}_nests": moved})

    return make


def table_tilted(run: Run, chance: Chance) -> Run:
    """The platform's table was measured with its plane tilted by half a degree."""
    frame = Frame.of([0.0, 0.0, 0.0, 0.009, -0.006, 0.004])
    moved = {n: frame.apply(at[:, None])[:, 0] for n, at in run.header.platform_nests.items()}
    return with_header(run, platform_nests=moved)


def nest_in_inches(run: Run, chance: Chance) -> Run:
    """One nest of the platform's table is in inches."""
    name = str(chance.choice(read_nests(run)))
    nests = run.header.platform_nests
    return with_header(run, platform_nests={**nests, name: nests[name] / 25.4})


def pass_in(factor: float) -> Make:
    """X, y, z of one nest's readings in another unit."""

    def make(run: Run, chance: Chance) -> Run:
        name = str(chance.choice(read_nests(run)))
        here = np.array([nest == name for nest in run.nest])
        return replace(run, position=np.where(here, factor, 1.0) * run.position)

    return make


def moved_at(*steps: tuple[float, float]) -> Make:
    """The tracker moved, at each part of the run by so many mm."""

    def make(run: Run, chance: Chance) -> Run:
        for part, size in steps:
            run = moved_by(run, from_part(run, part), size, chance)
        return run

    return make


def moved_and_back(size: float, first: float = 0.2, last: float = 0.55) -> Make:
    """The tracker was moved, and later put back to where it stood."""

    def make(run: Run, chance: Chance) -> Run:
        moved = moved_by(run, from_part(run, first), size, chance)
        late = from_part(run, last)
        return replace(moved, position=np.where(late, run.position, moved.position))

    return make


def _unit(run: Run) -> float:
    return 2e-3 if machine_named(run.header.machine).actuators[0].unit == "rad" else 1.0


def slipped_at(*steps: tuple[int, float, float]) -> Make:
    """Actuators slipped: which (by number), at which part of the run, by how many mm (2 mrad)."""

    def make(run: Run, chance: Chance) -> Run:
        change = np.zeros_like(run.q)
        for k, part, size in steps:
            change[k % run.q.shape[0]] += np.where(
                np.arange(run.line.size) >= part * run.line.size, size * _unit(run), 0.0
            )
        return moved_actuators(run, machine_named(run.header.machine), change)

    return make


def clamped_a_while(run: Run, chance: Chance) -> Run:
    """One actuator stood still for a quarter of the run, and went on."""
    k, size = int(chance.integers(run.q.shape[0])), run.line.size
    change = np.zeros_like(run.q)
    here = slice(int(0.4 * size), int(0.65 * size))
    change[k, here] = run.q[k, here.start] - run.q[k, here]
    return moved_actuators(run, machine_named(run.header.machine), change)


def controller_digit(run: Run, chance: Chance) -> Run:
    """One reference of [controller.parameters] is off by 10 mm."""
    machine = machine_named(run.header.machine)
    names = [one.reference for one in machine.actuators if isinstance(one.reference, str)]
    name = str(chance.choice(names))
    stated = {name: float(machine.nominal[machine.index(name)] + 10.0)}
    return with_header(run, controller_parameters=stated)


def commands_by(rows: int, part: float = 0.0) -> Make:
    """Commands of a later (or earlier) row, from a part of the run on."""

    def make(run: Run, chance: Chance) -> Run:
        first = int(part * run.line.size)
        source = np.clip(np.arange(run.line.size) + rows, first, run.line.size - 1)
        late = np.arange(run.line.size) >= first
        return replace(run, q=np.where(late, run.q[:, source], run.q))

    return make


def commands_of_next_pose(run: Run, chance: Chance) -> Run:
    """Each reading on the platform bears q of the pose after it: logged too early."""
    rows = np.flatnonzero(on_platform(run))
    new = [k for k in range(1, rows.size) if run.pose[rows[k]] != run.pose[rows[k - 1]]]
    q = run.q.copy()
    for first, last in zip([0, *new], [*new, rows.size], strict=True):
        q[:, rows[first:last]] = run.q[:, [rows[min(last, rows.size - 1)]]]
    return replace(run, q=q)


def anisotropic(run: Run) -> Run:
    """Readings of a tracker whose angles are worse than its range: noise added across the beam."""
    read = read_rows(run)
    position, covariance = run.position.copy(), run.covariance.copy()
    chance = np.random.default_rng(4)
    scale = np.array([1.0, 5.0, 3.0]) * 0.005
    position[:, read] += np.sqrt(scale**2 - 0.005**2)[:, None] * chance.normal(size=(3, read.size))
    covariance[:, :, read] = np.diag(scale**2)[:, :, None]
    return replace(run, position=position, covariance=covariance)


def sigmas_exchanged(run: Run, chance: Chance) -> Run:
    """Sigmas of x and y are exchanged where they differ by five."""
    run = anisotropic(run)
    swap = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return replace(run, covariance=np.einsum("ij,jkn,lk->iln", swap, run.covariance, swap))


def variances_um(run: Run, chance: Chance) -> Run:
    """Variances in um^2 under the names of the sigmas: 25 for 5 um."""
    told = run.covariance * 1e6
    return replace(run, covariance=np.where(np.isfinite(told), told**2, np.nan))


def sigmas_k2(run: Run, chance: Chance) -> Run:
    """Expanded uncertainties, k = 2."""
    return replace(run, covariance=4.0 * run.covariance)


def payload(change: Callable[[np.ndarray], np.ndarray], part: float = 0.0) -> Make:
    """Payload in another unit, from a part of the rows on."""

    def make(run: Run, chance: Chance) -> Run:
        values = run.channels["payload_kg"]
        late = np.arange(values.size) >= part * values.size
        return with_channel(run, "payload_kg", np.where(late, change(values), values))

    return make


def centre_in_inches(run: Run, chance: Chance) -> Run:
    """Centres of mass in inches."""
    load = run.header.load
    assert load is not None
    return with_header(
        run,
        load=replace(
            load, platform_com=load.platform_com / 25.4, payload_com=load.payload_com / 25.4
        ),
    )


def column_sentinel(name: str, value: float, rows: int = 3) -> Make:
    """A number that stands for nothing in some rows of a column."""

    def make(run: Run, chance: Chance) -> Run:
        values = run.channels[name].copy()
        values[chance.choice(values.size, rows, replace=False)] = value
        return with_channel(run, name, values)

    return make


def point_sentinel(value: float, axes: tuple[int, ...] = (0, 1, 2), rows: int = 1) -> Make:
    """A number that stands for nothing in x, y, z (or some of them) of some rows."""

    def make(run: Run, chance: Chance) -> Run:
        position = run.position.copy()
        for row in chance.choice(read_rows(run), rows, replace=False):
            position[list(axes), row] = value
        return replace(run, position=position)

    return make


def time_jumps(by: float, part: float = 0.5) -> Make:
    """The clock goes on by so many seconds at a part of the run (summer time, a pause)."""
    return lambda run, chance: replace(
        run, time_s=np.where(np.arange(run.line.size) >= part * run.line.size, by, 0.0) + run.time_s
    )


def late_minutes(run: Run, chance: Chance) -> Run:
    """From the middle on time_s goes on in minutes."""
    half = run.line.size // 2
    rest = run.time_s[half] + (run.time_s - run.time_s[half]) / 60.0
    return replace(run, time_s=np.where(np.arange(run.line.size) >= half, rest, run.time_s))


def block_twice(run: Run, chance: Chance) -> Run:
    """Fifteen rows were pasted once more, at the end."""
    read = read_rows(run)
    first = int(chance.integers(0, read.size - 15))
    return in_order(run, [*range(run.line.size), *read[first : first + 15]])


def smr_everywhere(height: float, *, base: bool = True) -> Make:
    """All nests (or those of the platform) were read with SMRs of another radius throughout."""

    def make(run: Run, chance: Chance) -> Run:
        turns = platform_turns(run, machine_named(run.header.machine))
        on = on_platform(run)
        upright = np.where(on, turns[:, 2, :], base_frame(run)[0][:, [2]])
        which = run.measured if base else on
        return replace(run, position=run.position + np.where(which, height * upright, 0.0))

    return make


def two_nests_wrong(run: Run, chance: Chance) -> Run:
    """One coordinate of two nests of the platform's table is off, by 1.5 mm and -2 mm."""
    nests = dict(run.header.platform_nests)
    for name, off in zip(read_nests(run)[:2], ([1.5, 0.0, 0.0], [0.0, -2.0, 0.0]), strict=True):
        nests[name] = nests[name] + np.array(off)
    return with_header(run, platform_nests=nests)


def first_poses(count: int) -> Make:
    """Only some poses were read."""

    def make(run: Run, chance: Chance) -> Run:
        labels = [p for p, on in zip(run.pose, on_platform(run), strict=True) if on]
        kept = set(list(dict.fromkeys(labels))[:count])
        rows = [
            k
            for k in range(run.line.size)
            if run.nest[k] not in run.header.platform_nests or run.pose[k] in kept
        ]
        return in_order(run, rows)

    return make


def axes_of_a_pass(run: Run, chance: Chance) -> Run:
    """Axes y and z of one nest's readings are exchanged."""
    here = np.array([nest == read_nests(run)[1] for nest in run.nest])
    return replace(run, position=np.where(here, run.position[[0, 2, 1]], run.position))
