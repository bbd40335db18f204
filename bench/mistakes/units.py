"""Mistakes of units, signs and order in columns, and in the header."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bench.mistakes.clean import at_rows, from_part, read_rows, with_channel, with_header
from calib.runs.record import Run

Chance = np.random.Generator
Make = Callable[[Run, Chance], Run]


def points_times(factor: float) -> Make:
    """X, y, z in another unit."""
    return lambda run, chance: replace(run, position=factor * run.position)


def points_late_in_m(run: Run, chance: Chance) -> Run:
    """X, y, z in metres from the middle on."""
    scale = np.where(from_part(run, 0.5), 0.001, 1.0)
    return replace(run, position=scale * run.position)


def points_axes(order: Sequence[int], signs: Sequence[float] = (1.0, 1.0, 1.0)) -> Make:
    """X, y, z in another order, with other signs."""
    sign = np.array(signs)[:, None]
    return lambda run, chance: replace(run, position=sign * run.position[list(order)])


def points_rounded(step: float) -> Make:
    """X, y, z are rounded to ``step`` mm."""
    return lambda run, chance: replace(run, position=np.round(run.position / step) * step)


def one_digit(run: Run, chance: Chance) -> Run:
    """One digit of one coordinate of one reading is wrong."""
    row = int(chance.choice(read_rows(run)))
    position = run.position.copy()
    off = chance.choice([-1.0, 1.0]) * 10.0 ** chance.integers(0, 3)
    position[chance.integers(3), row] += off
    return replace(run, position=position)


def q_times(factor: float) -> Make:
    """All q in another unit."""
    return lambda run, chance: replace(run, q=factor * run.q)


def q_from_home(home: Callable[[Run], np.ndarray], factor: float = 1.0) -> Make:
    """Q counted from home."""
    return lambda run, chance: replace(run, q=factor * (run.q - home(run)))


def q_rounded(step: float) -> Make:
    """Q is rounded to ``step``."""
    return lambda run, chance: replace(run, q=np.round(run.q / step) * step)


def q_exchanged(run: Run, chance: Chance) -> Run:
    """Two columns of q are exchanged."""
    first, second = chance.choice(run.q.shape[0], 2, replace=False)
    q = run.q.copy()
    q[[first, second]] = q[[second, first]]
    return replace(run, q=q)


def q_one_sign(home: Callable[[Run], np.ndarray]) -> Make:
    """One column of q counts the other way, from home."""

    def make(run: Run, chance: Chance) -> Run:
        q, k = run.q.copy(), int(chance.integers(run.q.shape[0]))
        q[k] = 2.0 * home(run)[k] - q[k]
        return replace(run, q=q)

    return make


def q_reversed(run: Run, chance: Chance) -> Run:
    """The columns of q in reversed order."""
    return replace(run, q=run.q[::-1])


def time_times(factor: float) -> Make:
    """time_s in another unit."""
    return lambda run, chance: replace(run, time_s=factor * run.time_s)


def time_standing(run: Run, chance: Chance) -> Run:
    """All rows have the same time."""
    return replace(run, time_s=np.zeros_like(run.time_s))


def sigmas_times(factor: float) -> Make:
    """Sx, sy, sz in another unit."""
    return lambda run, chance: replace(run, covariance=factor**2 * run.covariance)


def some_sigmas_times(factor: float) -> Make:
    """Three of them."""

    def make(run: Run, chance: Chance) -> Run:
        rows = chance.choice(read_rows(run), 3, replace=False)
        scale = np.where(at_rows(run, rows), factor**2, 1.0)
        return replace(run, covariance=scale * run.covariance)

    return make


def late_sigmas_in_um(run: Run, chance: Chance) -> Run:
    """Those from the middle on in um."""
    scale = np.where(from_part(run, 0.5), 1e6, 1.0)
    return replace(run, covariance=scale * run.covariance)


def variances(run: Run, chance: Chance) -> Run:
    """Variances in mm^2 under the names of the sigmas."""
    return replace(run, covariance=np.where(np.isfinite(run.covariance), run.covariance**2, np.nan))


def temperature(
    change: Callable[[np.ndarray], np.ndarray], name: str = "structure_temp_C", part: float = 0.0
) -> Make:
    """A temperature in another unit, from a part of the run on."""

    def make(run: Run, chance: Chance) -> Run:
        values = run.channels[name]
        late = np.arange(values.size) >= part * values.size
        return with_channel(run, name, np.where(late, change(values), values))

    return make


def payload_times(factor: float) -> Make:
    """payload_kg in another unit."""
    return lambda run, chance: with_channel(run, "payload_kg", factor * run.channels["payload_kg"])


def payload_late_in_grams(run: Run, chance: Chance) -> Run:
    """Grams in the last third alone."""
    values = run.channels["payload_kg"]
    late = np.arange(values.size) >= 2 * values.size // 3
    return with_channel(run, "payload_kg", np.where(late, 1000.0 * values, values))


def payload_lost(run: Run, chance: Chance) -> Run:
    """999 in three rows."""
    values = run.channels["payload_kg"].copy()
    values[chance.choice(values.size, 3, replace=False)] = 999.0
    return with_channel(run, "payload_kg", values)


def gravity(change: Callable[[np.ndarray], np.ndarray]) -> Make:
    """Gravity in another unit or direction."""

    def make(run: Run, chance: Chance) -> Run:
        load = run.header.load
        assert load is not None
        return with_header(run, load=replace(load, gravity=change(load.gravity)))

    return make


def centre_in_m(run: Run, chance: Chance) -> Run:
    """Centres of mass in metres."""
    load = run.header.load
    assert load is not None
    return with_header(
        run,
        load=replace(
            load, platform_com=load.platform_com / 1000.0, payload_com=load.payload_com / 1000.0
        ),
    )


def platform_mass_in_grams(run: Run, chance: Chance) -> Run:
    """[load] platform_mass_kg in grams."""
    load = run.header.load
    assert load is not None
    return with_header(run, load=replace(load, platform_mass_kg=1000.0 * load.platform_mass_kg))
