"""What the poses of a closed controller refer to, compared: pivot, coordinate system, rotations."""

from collections.abc import Mapping

SAME = 1e-6
"""Numbers in their words (mm, rad) that are nearer than this are the same."""


def frames_apart(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """In what two frames differ, in words: of all that both tell; empty if in nothing."""
    return [
        f"{name} was {before[name]}, and is {now[name]}"
        for name in before
        if name in now and not _same(before[name], now[name])
    ]


def _same(one: str, other: str) -> bool:
    """Whether two words say the same; numbers may be written in different ways."""
    try:
        first, second = ([float(part) for part in text.split()] for text in (one, other))
    except ValueError:
        return one.split() == other.split()
    return len(first) == len(second) and all(
        abs(a - b) <= SAME for a, b in zip(first, second, strict=True)
    )
