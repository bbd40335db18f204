"""LinuxCNC's INI and HAL files: what they say, and how a few of their numbers are rewritten.

Only text: nothing here talks to LinuxCNC. A rewritten file keeps every other line, and the old one
stays beside it (``hexapod.hal.0001.before``).
"""

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import ParameterError, Refused

_SECTION = re.compile(r"\s*\[\s*(\w+)\s*\]")
_ENTRY = re.compile(r"\s*(\w+)\s*=\s*(.*?)\s*$")
_SETP = re.compile(r"(\s*setp\s+(\S+)\s+)(\S+)(.*)")
_OF_INI = re.compile(r"\[(\w+)\]\(?(\w+)\)?$")


@dataclass(frozen=True)
class Ini:
    """An INI file: its entries by section, repeated ones in their order."""

    path: Path
    entries: Mapping[tuple[str, str], tuple[str, ...]]

    @classmethod
    def read(cls, path: Path) -> "Ini":
        """Read the file; raises Refused if it cannot be read."""
        entries: dict[tuple[str, str], tuple[str, ...]] = {}
        for section, key, value in _entries(read(path)):
            entries[section, key] = (*entries.get((section, key), ()), value)
        return cls(path, entries)

    def get(self, section: str, key: str, default: str = "") -> str:
        """The first value of an entry."""
        return self.entries.get((section, key), (default,))[0]

    def number(self, section: str, key: str, default: float = 0.0) -> float:
        """The first value as a number; raises Refused if it is none."""
        return self.value(self.get(section, key) or repr(default))

    def value(self, said: str) -> float:
        """A number as a HAL file writes it: itself, or ``[SECTION]KEY`` of the INI file."""
        found = _OF_INI.match(said)
        text = self.get(found[1], found[2]) if found else said
        try:
            return float(text.split("#")[0])
        except ValueError:
            raise Refused(
                f"{said} is {text!r}, no number",
                device=str(self.path),
                remedy="Write a number there, then start LinuxCNC again.",
            ) from None

    @property
    def hal_files(self) -> list[Path]:
        """The HAL files that it names and that are files."""
        names = [
            name.split()[0]
            for key in ("HALFILE", "POSTGUI_HALFILE")
            for name in self.entries.get(("HAL", key), ())
            if name
        ]
        return [path for name in names if (path := self.path.parent / name).is_file()]

    def pins(self) -> dict[str, float]:
        """Every number that its HAL files set a pin to, the last one where there are several."""
        found = {}
        for path in self.hal_files:
            for line in read(path).splitlines():
                if (setp := _SETP.match(line)) and _is_number(setp[3]):
                    found[setp[2]] = self.value(setp[3])
        return found


def _is_number(said: str) -> bool:
    return bool(_OF_INI.match(said) or re.fullmatch(r"[-+.\d]+([eE][-+]?\d+)?", said))


def read(path: Path) -> str:
    """The text of a file; raises Refused if there is none."""
    try:
        return path.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError as error:
        raise Refused(
            f"cannot be read ({error.strerror})",
            device=str(path),
            remedy="Check ini and hal under [controller] of the site file",
        ) from error


def _entries(text: str) -> Iterator[tuple[str, str, str]]:
    section = ""
    for line in text.splitlines():
        if line.lstrip().startswith(("#", ";")):
            continue
        if found := _SECTION.match(line):
            section = found[1]
        elif entry := _ENTRY.match(line):
            yield section, entry[1], entry[2]


def with_entries(text: str, values: Mapping[tuple[str, str], float]) -> str:
    """An INI text with other numbers; entries that were not there follow their section's head.

    Raises ParameterError for a section that the text does not have.
    """
    lines: list[str] = []
    section, left = "", dict(values)
    heads: dict[str, int] = {}
    for line in text.splitlines():
        if found := _SECTION.match(line):
            section = found[1]
            heads.setdefault(section, len(lines) + 1)
        elif (entry := _ENTRY.match(line)) and (section, entry[1]) in values:
            line = f"{entry[1]} = {values[section, entry[1]]!r}"
            left.pop((section, entry[1]), None)
        lines.append(line)
    for (section, key), value in sorted(left.items(), key=lambda one: heads.get(one[0][0], 0))[
        ::-1
    ]:
        if section not in heads:
            raise ParameterError(
                f"there is no [{section}] in the INI file, where {key} is to be stored",
                device="LinuxCNC",
                remedy="Write it into the INI file itself, not into an included one",
            )
        lines.insert(heads[section], f"{key} = {value!r}")
    return "\n".join(lines) + "\n"


def with_pins(text: str, values: Mapping[str, float]) -> str:
    """A HAL text whose ``setp`` lines set other numbers; those that were not there follow it."""
    lines, left = [], dict(values)
    for line in text.splitlines():
        if (setp := _SETP.match(line)) and setp[2] in values:
            line = f"{setp[1]}{values[setp[2]]!r}{setp[4]}"
            left.pop(setp[2], None)
        lines.append(line)
    lines += [f"setp {name} {value!r}" for name, value in left.items()]
    return "\n".join(lines) + "\n"


def write_surely(path: Path, text: str) -> None:
    """Replace a file at once; the old one stays as ``NAME.0001.before``, ``0002`` ..."""
    path = path.resolve()  # a link stays a link
    number = 1 + len(list(path.parent.glob(f"{path.name}.[0-9][0-9][0-9][0-9].before")))
    kept = path.with_name(f"{path.name}.{number:04d}.before")
    for place, content in ((kept, read(path)), (draft := _draft(path), text)):
        with place.open("w", encoding="utf-8", errors="surrogateescape") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    draft.chmod(path.stat().st_mode)
    draft.replace(path)
    if not hasattr(os, "O_DIRECTORY"):
        return  # Windows has no folders that can be synced
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _draft(path: Path) -> Path:
    return path.with_name(path.name + ".draft")
