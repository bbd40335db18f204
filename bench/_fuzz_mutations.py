"""Things that happen to files: cut, doubled, garbled, numbers beyond sense, other types, bytes.

A mutation is drawn from a seeded generator and says of itself whether what it did is a fault of
structure or range, which a reader has to refuse (``faulty``), or may still be a file.
"""

import random
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass

import tomli_w

NASTY = (
    "", "0", "-1", "1e999", "nan", "inf", "-inf", "true", '"', "'", "[", "]", "{", "}", "=", ",",
    ":", "(", ")", "\n", "\t", "\x00", "é", "𝔘", "1.5.2", "q1", "12 deg", "0x10", "[[a]]", "**",
    "1e-400", "9" * 400, '"""', "#", ";", "-", "pkm-run/2", "limb9", "Rx", "::", "../..", "\u202e",
    "\x1b[31m", "[bold red]", "<script>", "${x}", "{{ 7*7 }}", "1_000", "0b1", "--", "NaN", "+",
    "1e300", "1e-300", "%n",
)  # fmt: skip
BEYOND = (
    "1e300", "-1e300", "1e999", "9" * 400, "-" + "9" * 400, "nan", "inf", "-inf", "1e25", "-1e25",
    "9" * 5000,
)  # fmt: skip
_TYPES: tuple[object, ...] = ({}, [], [[]], {"a": 1}, "what?", [1, "a"], [True], -1, 3.5)
_NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w.])")


@dataclass(frozen=True)
class Spoilt:
    """A file's bytes, what was done to them, and whether no reader may take them."""

    data: bytes
    did: str
    faulty: bool = False


def spoilt(text: str, dice: random.Random, form: str) -> Spoilt:
    """One mutation of a text; ``form`` is csv, toml, or anything else of words."""
    ways = [*_ANY, *{"csv": _CELLS, "toml": _VALUES}.get(form, ())]
    found = dice.choice(ways)(text, dice)
    if dice.random() < 0.25 and not found.faulty:
        more = dice.choice(_ANY)(found.data.decode("utf-8", "replace"), dice)
        return Spoilt(more.data, f"{found.did}; {more.did}")
    return found


def _said(text: str, did: str, faulty: bool = False) -> Spoilt:
    return Spoilt(text.encode("utf-8", "surrogatepass"), did, faulty)


def _span(text: str, dice: random.Random, longest: int = 60) -> tuple[int, int]:
    first = dice.randint(0, len(text))
    return first, min(first + dice.randint(0, longest), len(text))


def _cut(text: str, dice: random.Random) -> Spoilt:
    first, last = _span(text, dice)
    return _said(text[:first] + text[last:], f"cut {first}:{last}")


def _end(text: str, dice: random.Random) -> Spoilt:
    first, _ = _span(text, dice)
    return _said(text[:first], f"ends at {first}")


def _insert(text: str, dice: random.Random) -> Spoilt:
    first, _ = _span(text, dice)
    what = dice.choice(NASTY)
    return _said(text[:first] + what + text[first:], f"{what[:20]!r} put at {first}")


def _double(text: str, dice: random.Random) -> Spoilt:
    first, last = _span(text, dice, 400)
    return _said(text[:last] + text[first:], f"{first}:{last} twice")


def _lines(text: str, dice: random.Random) -> Spoilt:
    lines = text.split("\n")
    one, two = dice.randrange(len(lines)), dice.randrange(len(lines))
    how = dice.choice(("exchanged", "dropped", "doubled", "moved"))
    if how == "exchanged":
        lines[one], lines[two] = lines[two], lines[one]
    elif how == "dropped":
        del lines[one]
    elif how == "doubled":
        lines.insert(two, lines[one])
    else:
        lines.insert(two, lines.pop(one))
    return _said("\n".join(lines), f"lines {one + 1}, {two + 1} {how}")


def _word(text: str, dice: random.Random) -> Spoilt:
    words = re.split(r"(\W+)", text)
    place = dice.randrange(len(words))
    words[place] = dice.choice(NASTY)
    return _said("".join(words), f"word {place} is {words[place][:20]!r}")


def _digit(text: str, dice: random.Random) -> Spoilt:
    numbers = list(_NUMBER.finditer(text))
    if not numbers:
        return _end(text, dice)
    one = dice.choice(numbers)
    place = dice.randrange(one.start(), one.end())
    sign = dice.choice("0123456789.-e")
    return _said(text[:place] + sign + text[place + 1 :], f"{sign!r} at {place}")


def _bytes(text: str, dice: random.Random) -> Spoilt:
    data = bytearray(text.encode())
    for _ in range(dice.randint(1, 8) if data else 0):
        data[dice.randrange(len(data))] = dice.randrange(256)
    return Spoilt(bytes(data), "bytes")


def _encoding(text: str, dice: random.Random) -> Spoilt:
    how = dice.choice(("utf-16", "utf-8-sig", "latin-1", "crlf", "cr", "nul", "empty", "noise"))
    if how in ("crlf", "cr"):
        end = "\r\n" if how == "crlf" else "\r"
        return Spoilt(text.replace("\n", end).encode(), how)
    if how == "nul":
        return Spoilt(bytes(len(text)), how)
    if how == "empty":
        return Spoilt(b"", how)
    if how == "noise":
        return Spoilt(dice.randbytes(dice.randint(1, 3000)), how)
    return Spoilt(text.encode(how, "replace"), how)


def _much(text: str, dice: random.Random) -> Spoilt:
    first, last = _span(text, dice, 30)
    how = dice.choice(("[", "{", "(", "a", "9", " ", "\n", "-", "a.", "x=1\n", text[first:last]))
    count = dice.choice((300, 3000, 30000))
    return _said(text[:first] + how * count + text[first:], f"{count} of {how[:10]!r} at {first}")


def _beyond_cell(text: str, dice: random.Random) -> Spoilt:
    return _cell(text, dice, dice.choice(BEYOND))


def _no_number(text: str, dice: random.Random) -> Spoilt:
    return _cell(text, dice, dice.choice(("abc", "1.2.3", "--1", "1e", "12 parsec", "0x12", "1 2")))


def _cell(text: str, dice: random.Random, what: str) -> Spoilt:
    """Another value in place of a number of a table."""
    lines = text.split("\n")
    numbers = [
        (line, cell)
        for line, said in enumerate(lines)
        for cell, value in enumerate(said.split(","))
        if re.fullmatch(r"[+-]?\d+\.\d*(?:e[+-]?\d+)?", value)
    ]
    if not numbers:
        return _end(text, dice)
    line, cell = dice.choice(numbers)
    cells = lines[line].split(",")
    cells[cell] = what
    lines[line] = ",".join(cells)
    return _said("\n".join(lines), f"line {line + 1}, cell {cell + 1} is {what[:12]}", True)


def _ragged(text: str, dice: random.Random) -> Spoilt:
    lines = text.split("\n")
    full = [k for k, line in enumerate(lines) if k and line.count(",") > 3]
    if not full:
        return _end(text, dice)
    line = dice.choice(full)
    cells = lines[line].split(",")
    if dice.random() < 0.5:
        cells.append("7")
    else:
        del cells[dice.randrange(len(cells))]
    lines[line] = ",".join(cells)
    return _said("\n".join(lines), f"line {line + 1} has {len(cells)} cells", True)


def _places(node: object) -> list[tuple[object, object]]:
    inside = node.items() if isinstance(node, dict) else enumerate(node)  # type: ignore[arg-type]
    found: list[tuple[object, object]] = []
    for key, value in inside:
        found.append((node, key))
        if isinstance(value, dict | list):
            found += _places(value)
    return found


def _value(text: str, dice: random.Random, pick: Callable[[object], object | None]) -> Spoilt:
    """Another value under a key of TOML; ``pick`` gives it, None where the old is left alone."""
    try:
        data = tomllib.loads(text)
    except ValueError:
        return _end(text, dice)
    places = _places(data)
    dice.shuffle(places)
    for node, key in places:
        old = node[key]  # type: ignore[index]
        new = pick(old)
        if new is not None:
            node[key] = new  # type: ignore[index]
            return _said(_dumped(data), f"{key} = {str(new)[:20]} for {str(old)[:20]}")
    return _end(text, dice)


_RAW = re.compile(r'"RAW:([^"]*)"')


def _dumped(data: object) -> str:
    assert isinstance(data, dict)
    return _RAW.sub(r"\1", tomli_w.dumps(data))


def _beyond_value(text: str, dice: random.Random) -> Spoilt:
    def pick(old: object) -> object | None:
        number = isinstance(old, int | float) and not isinstance(old, bool)
        return f"RAW:{dice.choice(BEYOND)}" if number else None

    found = _value(text, dice, pick)
    return Spoilt(found.data, found.did, not found.did.startswith("ends"))


def _other_type(text: str, dice: random.Random) -> Spoilt:
    return _value(text, dice, lambda old: dice.choice(_TYPES))


def _removed(text: str, dice: random.Random) -> Spoilt:
    data = tomllib.loads(text)
    node, key = dice.choice(_places(data))
    del node[key]  # type: ignore[attr-defined]
    return _said(tomli_w.dumps(data), f"without {key}")


def _renamed(text: str, dice: random.Random) -> Spoilt:
    data = tomllib.loads(text)
    tables = [(node, key) for node, key in _places(data) if isinstance(node, dict)]
    node, key = dice.choice(tables)
    assert isinstance(node, dict)
    name = dice.choice((f"{key}x", str(key)[:-1], "a b", "ü", "", "__class__", "1"))
    node[name] = node.pop(key)
    return _said(tomli_w.dumps(data), f"{key} is called {name!r}")


_ANY = (
    _cut, _end, _insert, _double, _lines, _word, _word, _digit, _digit, _bytes, _encoding, _much,
)  # fmt: skip
_CELLS = (_beyond_cell, _beyond_cell, _no_number, _no_number, _ragged)
_VALUES = (
    _beyond_value,
    _beyond_value,
    _beyond_value,
    _other_type,
    _other_type,
    _removed,
    _renamed,
)
