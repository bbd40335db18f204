"""What the columns of a table most likely are: parts of a first map, every assumption marked."""

import re
from collections.abc import Sequence

import numpy as np

from app.files.foreign_numbers import parse_number
from app.files.foreign_table import ForeignTable
from app.files.import_map import FORMAT
from app.files.shipped_maps import shipped_map
from app.files.time_forms import are_days, either_way, form_of
from calib.mechanism.description import Machine

LOOKED_AT = 200
"""Rows by which the form of times is guessed."""
_NAMES = {
    "time": r"time|zeit|date.?time|timestamp|date|datum|uhrzeit",
    "pose": r"pose|target|point|config|label|name|punkt|stellung|position.?id|id",
    "nest": r"nest|smr|reflector|marker|probe|prism|kugel|reflektor|ball|target.?id",
    "station": r"station|instrument",
}
_ACTUATOR = r"(?i)(?:q|j|joint|axis|a|theta|leg|motor|limb)[ _]?\[?(\d+)\]?(?:[ _]?(?:deg|rad|mm))?"


class Guess:
    """The parts of a map, each with the remark why it is so."""

    def __init__(self, table: ForeignTable, machine: Machine | None, name: str | None) -> None:
        self.table, self.machine, self.name = table, machine, name
        self.assumed: list[str] = []
        self.missing: list[str] = []
        self.taken: set[int] = set()

    def text(self) -> str:
        """The whole map."""
        head, file = self._head(), self._file()
        if shipped := self._shipped():
            return "\n".join([head, file, self._as_shipped(shipped)])
        time = self._time()
        labels = [self._label("pose", "same_joints = true"), self._label("nest", "")]
        labels.append(self._station())
        reading, sigma, channels = self._reading(), self._sigma(), self._channels()
        actuators = self._actuators()
        parts = [head, file, time, *labels, actuators, reading, sigma, channels, self._rest()]
        return "\n".join(part for part in parts if part)

    def _head(self) -> str:
        self.missing.append("[nests.platform] and [nests.base]: where each nest is, mm")
        if self.name is None:
            self.missing.append("machine: the machine file, or the name of a shipped machine")
        machine = '# TO BE COMPLETED: the machine\n# machine = "hexapod"'
        if self.name:
            machine = f'machine = "{self.name}"'
        return (
            "# A first map, made by looking at the file. Check what is marked ASSUMED.\n"
            f'format = "{FORMAT}"\n{machine}\n'
            "\n# TO BE COMPLETED: centres of the nests, mm; take the # away\n"
            "# [nests.platform]\n# T1 = [0.0, 100.0, 0.0]\n\n# [nests.base]\n"
            "# b1 = [260.0, 0.0, -30.0]\n"
        )

    def _file(self) -> str:
        layout = self.table.layout
        self.assumed.append(
            f'[file] {layout.encoding}, "{layout.delimiter}" between columns, '
            f'"{layout.decimal}" before decimals, {layout.skip} lines before the table, '
            f"{'a line of names' if layout.header else 'no line of names'}"
            + (f", and an end before a line that begins as {layout.end}" if layout.end else "")
        )
        lines = [
            "[file]  # ASSUMED",
            f'encoding = "{layout.encoding}"',
            f'delimiter = "{layout.delimiter}"',
            f'decimal = "{layout.decimal}"',
            f"comments = {_listed(layout.comments)}",
            f"skip = {layout.skip}",
            f"header = {str(layout.header).lower()}",
            f"units_row = {str(layout.units_row).lower()}",
            *([f"end = '{layout.end}'  # lines behind the table"] if layout.end else []),
            'missing = ["-", "n/a", "null"]  # cells that say that there is nothing',
            "",
        ]
        return "\n".join(lines)

    def _shipped(self) -> str:
        """Which shipped map reads a table of this shape: names, then three numbers."""
        table = self.table
        numeric = [self._numeric(at) for at in range(table.width)]
        cell = table.rows[0][0]
        if table.layout.header:
            return ""
        if len(numeric) == 6 and not (numeric[0] or numeric[2]) and all(numeric[3:]):
            return "spatial-analyzer"
        return "polyworks" if numeric == [False] + [True] * 3 and "_" in cell else ""

    def _as_shipped(self, name: str) -> str:
        """Columns, labels and sizes as the shipped map of that program has them."""
        self.assumed.append(
            f'everything else as the map that ships, "{name}": pose, nest, order, mm, 15 um'
        )
        self.missing.append("--commands FILE: what was commanded, by the label of the pose")
        text = shipped_map(name)
        return f'# ASSUMED: as in the map "{name}", which ships\n{text[text.index("[time]") :]}'

    def _time(self) -> str:
        at = self._find("time")
        if at is None:
            self.assumed.append("[time] no column of times was found: rows are 10 s apart")
            return "[time]  # ASSUMED: no column of times was found\nstep_s = 10.0\n"
        columns, form = [at], self._form([at])
        if form is None and (other := self._find("time")) is not None:
            columns.append(other)  # a column of dates, and one of times of the day
            form = self._form(columns)
        form = form or "iso"
        names = '" and "'.join(map(self.table.column_name, columns))
        either = either_way(form, self._times(columns))
        doubt = "; day and month may be exchanged" if either else ""
        self.assumed.append(f'[time] column "{names}" holds "{form}"{doubt}')
        unit = '\nunit = "s"  # ASSUMED' if form == "s" and not self.table.units[at] else ""
        column = ", ".join(map(self._name, columns))
        return (
            f"[time]  # ASSUMED{doubt}\ncolumn = {f'[{column}]' if len(columns) > 1 else column}\n"
            f'form = "{form}"  # "s", "iso", "clock", "excel", or a pattern: "%d.%m.%Y %H:%M:%S"'
            f"{unit}\n"
        )

    def _times(self, columns: Sequence[int]) -> list[str]:
        rows = self.table.rows[:LOOKED_AT]
        return [" ".join(row[at].strip() for at in columns) for row in rows]

    def _form(self, columns: Sequence[int]) -> str | None:
        """The form of times; None if these columns hold none, or dates alone."""
        texts = self._times(columns)
        if len(columns) == 1:
            values = [parse_number(text, self.table.layout) for text in texts]
            numbers = [one for one in values if one is not None]
            if len(numbers) == len(texts):
                stated = self.table.units[columns[0]]
                return "excel" if not stated and are_days(numbers) else "s"
            if all(len(text) <= 10 for text in texts) and form_of(texts) in (None, "iso"):
                return None
        return form_of(texts)

    def _label(self, key: str, otherwise: str) -> str:
        at = self._find(key)
        if at is not None:
            self.assumed.append(f'[{key}] column "{self.table.column_name(at)}"')
            pattern = "pattern = '^(.+)_' takes a part of the label"
            return f"[{key}]  # ASSUMED; {pattern}\ncolumn = {self._name(at)}\n"
        if otherwise:
            self.assumed.append(f"[{key}] no such column was found: {otherwise}")
            return f"[{key}]  # ASSUMED\n{otherwise}\n"
        self.missing.append(f'{key}: no such column was found; write {key} = "..." in [[reading]]')
        return ""

    def _station(self) -> str:
        at = self._find("station")
        return (
            "" if at is None else f"[station]  # ASSUMED: a run each\ncolumn = {self._name(at)}\n"
        )

    def _actuators(self) -> str:
        found: dict[int, int] = {}
        for at, name in enumerate(self.table.names):
            match = re.fullmatch(_ACTUATOR, name)
            if match and at not in self.taken and self._numeric(at):
                found.setdefault(int(match[1]), at)
        columns = [found[number] for number in sorted(found)]
        wanted = None if self.machine is None else len(self.machine.actuators)
        left = [at for at in range(self.table.width) if at not in self.taken and self._numeric(at)]
        if not columns and len(left) == wanted:
            columns = left
        if not columns or (wanted is not None and len(columns) != wanted):
            self.missing.append("[actuators]: the columns of the actuators, in the machine's order")
            return (
                "# TO BE COMPLETED: the columns of the actuators\n# [actuators]\n# columns = []\n"
            )
        self.taken |= set(columns)
        names = ", ".join(self.table.column_name(at) for at in columns)
        self.assumed.append(f"[actuators] {names}, in this order, signs and zeros as they stand")
        lines = ["[actuators]  # ASSUMED", f"columns = [{', '.join(map(self._name, columns))}]"]
        if not all(self.table.units[at] for at in columns):
            unit = self._actuator_unit(columns)
            self.assumed.append(f"[actuators] unit {unit}, by the size of the numbers")
            lines.append(f'unit = "{unit}"  # ASSUMED by the size of the numbers')
        lines.append("# sign = [1, ...]; gear = [1.0, ...]; offset = [0.0, ...]")
        return "\n".join([*lines, ""])

    def _actuator_unit(self, columns: Sequence[int]) -> str:
        size = max(float(np.nanmax(np.abs(self._values(at)))) for at in columns)
        turning = self.machine is None or self.machine.actuators[0].unit == "rad"
        if not turning:
            return "m" if size < 5.0 else "mm"
        return "rad" if size <= 2.0 * np.pi + 0.01 else "deg"

    def _reading(self) -> str:
        columns = [
            self._axis(rf"(?i)(?:.*[ _])?{axis}(?:[ _](?:mm|m|meas|measured))?") for axis in "xyz"
        ]
        if None in columns:
            self.missing.append("[[reading]]: the columns of x, y, z")
            return (
                "# TO BE COMPLETED: where the readings stand\n"
                '# [[reading]]\n# columns = ["X", "Y", "Z"]\n# unit = "mm"\n'
            )
        chosen = [at for at in columns if at is not None]
        names = ", ".join(self.table.column_name(at) for at in chosen)
        lines = ["[[reading]]  # ASSUMED", f"columns = [{', '.join(map(self._name, chosen))}]"]
        if not all(self.table.units[at] for at in chosen):
            size = max(float(np.nanmax(np.abs(self._values(at)))) for at in chosen)
            unit = "mm" if size > 30.0 else "m"
            self.assumed.append(f"[[reading]] {names} in {unit}, by the size of the numbers")
            lines.append(f'unit = "{unit}"  # ASSUMED by the size of the numbers')
        else:
            self.assumed.append(f"[[reading]] {names}")
        return "\n".join([*lines, ""])

    def _sigma(self) -> str:
        columns = [self._axis(rf"(?i)(?:s|u|sigma|std|unc|u95)[ _]?{axis}") for axis in "xyz"]
        if None in columns:
            self.assumed.append("[sigma] 15 um for every reading: the file says nothing")
            return '[sigma]  # ASSUMED: the file says nothing (1 sigma)\nvalue = "15 um"\n'
        chosen = [at for at in columns if at is not None]
        self.assumed.append("[sigma] 1 sigma (coverage = 2 if they are expanded)")
        lines = ["[sigma]  # ASSUMED: 1 sigma; coverage = 2 if they are expanded"]
        lines.append(f"columns = [{', '.join(map(self._name, chosen))}]")
        if not all(self.table.units[at] for at in chosen):
            self.assumed.append("[sigma] unit mm")
            lines.append('unit = "mm"  # ASSUMED')
        return "\n".join([*lines, ""])

    def _channels(self) -> str:
        lines: list[str] = []
        for at, name in enumerate(self.table.names):
            if at in self.taken or not self._numeric(at):
                continue
            stated = self.table.units[at]
            if re.search(r"(?i)temp|^T$|^T[_ ]", name) or stated in ("degC", "K", "degF", "°C"):
                self.taken.add(at)
                own = re.sub(r"\W+", "_", name)
                key = f"{own}_C" if lines else "structure_temp_C"
                unit = "" if stated else ', unit = "degC"'
                self.assumed.append(f'[channels] "{name}" is a temperature')
                lines.append(f"{key} = {{ column = {self._name(at)}{unit} }}")
        return "\n".join(["[channels]  # ASSUMED", *lines, ""]) if lines else ""

    def _rest(self) -> str:
        left = [at for at in range(self.table.width) if at not in self.taken]
        names = ", ".join(self.table.column_name(at) for at in left)
        return f"# Columns that are not used: {names}\n" if left else ""

    def _find(self, key: str) -> int | None:
        pattern = rf"(?:.*[ _])?(?:{_NAMES[key]})(?:[ _].*)?"
        for at, name in enumerate(self.table.names):
            if at not in self.taken and re.fullmatch(pattern, name, re.IGNORECASE):
                self.taken.add(at)
                return at
        return None

    def _axis(self, pattern: str) -> int | None:
        for at, name in enumerate(self.table.names):
            if at not in self.taken and re.fullmatch(pattern, name) and self._numeric(at):
                self.taken.add(at)
                return at
        return None

    def _numeric(self, at: int) -> bool:
        cells = [row[at].strip() for row in self.table.rows[:50]]
        good = sum(parse_number(cell, self.table.layout) is not None for cell in cells)
        return good > 0.5 * len(cells)

    def _values(self, at: int) -> np.ndarray:
        found = [parse_number(row[at].strip(), self.table.layout) for row in self.table.rows]
        return np.array([np.nan if one is None else one for one in found])

    def _name(self, at: int) -> str:
        name = self.table.names[at]
        unique = name and self.table.names.count(name) == 1
        escaped = name.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"' if unique else str(at + 1)


def _listed(texts: Sequence[str]) -> str:
    return "[" + ", ".join(f'"{one}"' for one in texts) + "]"
