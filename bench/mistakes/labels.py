"""Mistakes of labels and nest tables."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.mistakes.clean import at_rows, on_platform, read_nests, read_rows, with_header
from calib.arrays import BoolArray
from calib.runs.record import Run

Chance = np.random.Generator
Make = Callable[[Run, Chance], Run]


def _renamed(run: Run, other: dict[str, str], which: BoolArray | None = None) -> Run:
    rows = np.ones(run.line.size, dtype=bool) if which is None else which
    return replace(
        run,
        nest=tuple(
            other.get(name, name) if row else name for name, row in zip(run.nest, rows, strict=True)
        ),
    )


def _two(names: list[str], chance: Chance) -> dict[str, str]:
    first, second = (str(name) for name in chance.choice(names, 2, replace=False))
    return {first: second, second: first}


def nests_exchanged(run: Run, chance: Chance) -> Run:
    """Two labels of the platform are exchanged throughout."""
    return _renamed(run, _two(list(run.header.platform_nests), chance))


def nests_exchanged_late(run: Run, chance: Chance) -> Run:
    """The same from the middle on."""
    late = np.arange(run.line.size) >= run.line.size // 2
    return _renamed(run, _two(list(run.header.platform_nests), chance), late)


def nests_rotated(run: Run, chance: Chance) -> Run:
    """Three labels go round: 1 is read as 2, 2 as 3, 3 as 1."""
    names = list(run.header.platform_nests)
    return _renamed(run, dict(zip(names, names[1:] + names[:1], strict=True)))


def pass_in_another_hole(run: Run, chance: Chance) -> Run:
    """All readings of one nest were taken in another, whose label they do not bear."""
    names = list(run.header.platform_nests)
    first, second = (str(name) for name in chance.choice(names, 2, replace=False))
    return _renamed(run, {first: second})


def part_of_a_pass(run: Run, chance: Chance) -> Run:
    """The last half of one nest's readings bears another label."""
    first, second = _two(list(run.header.platform_nests), chance)
    rows = np.array([k for k in read_rows(run) if run.nest[k] == first])
    return _renamed(run, {first: second}, at_rows(run, rows[rows.size // 2 :]))


def one_wrong_hole(run: Run, chance: Chance) -> Run:
    """One reading bears another label."""
    first, second = _two(list(run.header.platform_nests), chance)
    rows = np.array([k for k in read_rows(run) if run.nest[k] == first])
    return _renamed(run, {first: second}, at_rows(run, chance.choice(rows, 1)))


def base_exchanged(run: Run, chance: Chance) -> Run:
    """Two labels of the base are exchanged throughout."""
    return _renamed(run, _two(list(run.header.base_nests), chance))


def base_exchanged_once(run: Run, chance: Chance) -> Run:
    """The same at the last visit alone."""
    rows = np.array([k for k in read_rows(run) if run.nest[k] in run.header.base_nests])
    return _renamed(run, _two(list(run.header.base_nests), chance), at_rows(run, rows[-4:]))


def mirrored(axis: int) -> Make:
    """The platform's nest table with the sign of one coordinate turned round."""

    def make(run: Run, chance: Chance) -> Run:
        flip = np.ones(3)
        flip[axis] = -1.0
        table = {name: flip * nest for name, nest in run.header.platform_nests.items()}
        return with_header(run, platform_nests=table)

    return make


def table_axes(run: Run, chance: Chance) -> Run:
    """X and y of the platform's table are exchanged."""
    table = {name: nest[[1, 0, 2]] for name, nest in run.header.platform_nests.items()}
    return with_header(run, platform_nests=table)


def table_turned(run: Run, chance: Chance) -> Run:
    """The platform's table is in a frame turned by 90 degrees about z."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    table = {name: turn @ nest for name, nest in run.header.platform_nests.items()}
    return with_header(run, platform_nests=table)


def table_off(run: Run, chance: Chance) -> Run:
    """The platform's table counts z from a face 25 mm higher."""
    table = {
        name: nest + np.array([0.0, 0.0, 25.0]) for name, nest in run.header.platform_nests.items()
    }
    return with_header(run, platform_nests=table)


def table_aside(run: Run, chance: Chance) -> Run:
    """The platform's table has another origin, 10 to 30 mm aside."""
    shift = np.append(chance.normal(size=2), 0.0)
    shift *= chance.uniform(10.0, 30.0) / np.linalg.norm(shift)
    table = {name: nest + shift for name, nest in run.header.platform_nests.items()}
    return with_header(run, platform_nests=table)


def table_scaled(factor: float) -> Make:
    """The platform's table in another unit."""

    def make(run: Run, chance: Chance) -> Run:
        table = {name: factor * nest for name, nest in run.header.platform_nests.items()}
        return with_header(run, platform_nests=table)

    return make


def one_number_wrong(run: Run, chance: Chance) -> Run:
    """One coordinate of one platform nest is off by 2 to 10 mm."""
    name = str(chance.choice(read_nests(run)))
    off = np.zeros(3)
    off[chance.integers(3)] = chance.choice([-1.0, 1.0]) * chance.uniform(2.0, 10.0)
    table = {**run.header.platform_nests, name: run.header.platform_nests[name] + off}
    return with_header(run, platform_nests=table)


def one_number_wrong_by_little(run: Run, chance: Chance) -> Run:
    """The first coordinate of one platform nest is off by 0.6 to 2 mm, across the nests' normal."""
    name = str(chance.choice(read_nests(run)))
    off = np.array([chance.choice([-1.0, 1.0]) * chance.uniform(0.6, 2.0), 0.0, 0.0])
    table = {**run.header.platform_nests, name: run.header.platform_nests[name] + off}
    return with_header(run, platform_nests=table)


def one_sign_wrong(run: Run, chance: Chance) -> Run:
    """One coordinate of one platform nest has the wrong sign."""
    table = dict(run.header.platform_nests)
    large = [(n, k) for n, nest in table.items() for k in range(3) if abs(nest[k]) > 20.0]
    name, axis = large[chance.integers(len(large))]
    nest = table[name].copy()
    nest[axis] = -nest[axis]
    return with_header(run, platform_nests={**table, name: nest})


def base_number_wrong(run: Run, chance: Chance) -> Run:
    """One coordinate of one base nest is off by 1 to 10 mm."""
    name = str(chance.choice(list(run.header.base_nests)))
    off = np.zeros(3)
    off[chance.integers(3)] = chance.choice([-1.0, 1.0]) * chance.uniform(1.0, 10.0)
    return with_header(
        run, base_nests={**run.header.base_nests, name: run.header.base_nests[name] + off}
    )


def base_nest_loose(run: Run, chance: Chance) -> Run:
    """One base nest was knocked by 0.3 mm to 2 mm in the middle of the run."""
    name = str(chance.choice(list(run.header.base_nests)))
    rows = np.array([k for k in read_rows(run) if run.nest[k] == name])
    position = run.position.copy()
    off = chance.normal(size=3)
    off *= chance.uniform(0.3, 2.0) / np.linalg.norm(off)
    position[:, rows[rows.size // 2 :]] += off[:, None]
    return replace(run, position=position)


def base_mirrored(run: Run, chance: Chance) -> Run:
    """The sign of y of all base nests."""
    flip = np.array([1.0, -1.0, 1.0])
    table = {name: flip * nest for name, nest in run.header.base_nests.items()}
    return with_header(run, base_nests=table)


def base_frame_off(run: Run, chance: Chance) -> Run:
    """The base's table counts z from another face, 25 mm off."""
    shift = np.array([0.0, 0.0, 25.0])
    table = {name: nest + shift for name, nest in run.header.base_nests.items()}
    return with_header(run, base_nests=table)


def base_turned(run: Run, chance: Chance) -> Run:
    """The base's table is turned by 90 degrees about z."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    table = {name: turn @ nest for name, nest in run.header.base_nests.items()}
    return with_header(run, base_nests=table)


def label_shared(run: Run, chance: Chance) -> Run:
    """The second pose bears the label of the first."""
    first, second = list(dict.fromkeys(label for label in run.pose if label and label != "home"))[
        :2
    ]
    return replace(run, pose=tuple(first if p == second else p for p in run.pose))


def labels_start_again(run: Run, chance: Chance) -> Run:
    """The labels of the poses begin again with 1 in the middle of the run."""
    labels = list(dict.fromkeys(p for p, on in zip(run.pose, on_platform(run), strict=True) if on))
    half = len(labels) // 2
    other = dict(zip(labels[half:], labels[:half], strict=False))
    return replace(run, pose=tuple(other.get(p, p) for p in run.pose))
