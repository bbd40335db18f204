"""Commands about parameters: SPA, SEP, WPA, RPA, DPA, CCL, HPA, with what is made to go wrong.

Injected faults: ``parameter-missing:NAME`` (unknown on the wire), ``parameter-nan:NAME`` and
``parameter-corrupt:NAME`` (answered wrongly), ``write-refused:NAME`` (error 333),
``write-lost:NAME`` (error 0, but the old value stays), ``store-refused`` (error 305).
"""

import math
from collections.abc import Callable, Mapping, Sequence

from mocks.gcs import parameters as par
from mocks.gcs.controller import ADVANCED, ADVANCED_PASSWORD, STORE_PASSWORD, Controller
from mocks.gcs.errors import Code, GcsError
from mocks.gcs.numbers import real, whole

CORRUPTION = 0.125


class ParameterCommands:
    """Carries them out; every method takes the words after the command."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._memory = controller.parameters
        self._faults = controller.machine.faults
        self.queries: dict[str, Callable[[list[str]], list[str]]] = {
            "SPA?": lambda words: self._read(words, self._memory.active),
            "SEP?": lambda words: self._read(words, self._memory.stored),
            "HPA?": self._help,
            "CCL?": lambda words: [str(controller.level)],
        }
        self.commands: dict[str, Callable[[list[str]], None]] = {
            "SPA": self._set,
            "SEP": self._set_stored,
            "WPA": self._store,
            "RPA": lambda words: self._take(self._names(words), self._memory.stored),
            "DPA": self._defaults,
            "CCL": self._level,
        }

    # ------------------------------------------------------------ reading

    def _help(self, words: list[str]) -> list[str]:
        missing = self._faults.arguments("parameter-missing")
        gone = {entry for entry in par.ENTRIES if self._all_missing(entry, missing)}
        return [
            "The following parameters are valid:",
            *(entry.line() for entry in par.ENTRIES if entry not in gone),
            "end of help",
        ]

    def _all_missing(self, entry: par.Entry, missing: frozenset[str]) -> bool:
        names = {name for (_, number), name in par.NAMES.items() if number == entry.number}
        return bool(names) and names <= missing

    def _keys(self, words: list[str]) -> list[par.Key]:
        """Items and identifiers in ``words``; all that there are if it is empty."""
        if not words:
            every = [(str(i + 1), e.number) for e in par.ENTRIES for i in range(e.items)]
            missing = self._faults.arguments("parameter-missing")
            return [key for key in every if par.NAMES.get(key) not in missing]
        if len(words) % 2:
            raise GcsError(Code.SYNTAX)
        return [self._key(*pair) for pair in zip(words[::2], words[1::2], strict=True)]

    def _key(self, item: str, number: str) -> par.Key:
        key = item, whole(number)
        entry = par.BY_NUMBER.get(key[1])
        if entry is None or par.NAMES.get(key) in self._faults.arguments("parameter-missing"):
            raise GcsError(Code.UNKNOWN_PARAMETER)
        if item not in {str(n + 1) for n in range(entry.items)}:
            raise GcsError(Code.NO_SUCH_AXIS)
        return key

    def _read(self, words: list[str], values: Mapping[str, float]) -> list[str]:
        shown = self._shown(values)
        return [f"{i} 0x{n:X}={self._value((i, n), shown)}" for i, n in self._keys(words)]

    def _value(self, key: par.Key, shown: Mapping[str, float]) -> str:
        controller = self._controller
        others: dict[int, Callable[[], float | int]] = {
            par.STRUCTURE_TEMP: controller.machine.structure_temp_C,
            par.PAYLOAD: lambda: controller.machine.payload_kg,
            par.CRC_IN_USE: lambda: par.checksum(self._shown(self._memory.active)),
            par.CRC_STORED: lambda: par.checksum(self._memory.stored),
            par.WATCHDOG: lambda: controller.watchdog_ms,
        }
        name = par.NAMES.get(key)
        value = shown[name] if name is not None else others[key[1]]()
        return str(value) if isinstance(value, int) else f"{value:.17g}"

    def _shown(self, values: Mapping[str, float]) -> dict[str, float]:
        shown = dict(values)
        for name in self._faults.arguments("parameter-corrupt") & shown.keys():
            shown[name] += CORRUPTION
        for name in self._faults.arguments("parameter-nan") & shown.keys():
            shown[name] = math.nan
        return shown

    # ------------------------------------------------------------ writing

    def _set(self, words: list[str]) -> None:
        wanted = self._assignments(words)
        others = {n: value for (_, n), value in wanted.items() if n not in par.QUANTITIES}
        for number, text in others.items():
            self._set_other(number, text)
        kinematic = {par.NAMES[key]: t for key, t in wanted.items() if key in par.NAMES}
        if kinematic:
            self._controller.need_servos_off()
            self._memory.active.update(self._accepted(kinematic))

    def _set_other(self, number: int, text: str) -> None:
        if number != par.WATCHDOG:
            raise GcsError(Code.READ_ONLY)
        value = whole(text)
        if not 0 <= value <= 60000:
            raise GcsError(Code.OUT_OF_RANGE)
        self._controller.watchdog_ms = value

    def _assignments(self, words: list[str]) -> dict[par.Key, str]:
        if not words or len(words) % 3:
            raise GcsError(Code.SYNTAX)
        triples = zip(words[::3], words[1::3], words[2::3], strict=True)
        return {self._key(item, number): value for item, number, value in triples}

    def _accepted(self, texts: Mapping[str, str]) -> dict[str, float]:
        """Check kinematic values: all of them are good, or none is taken."""
        if self._controller.level < ADVANCED:
            raise GcsError(Code.PROTECTED)
        values = {name: real(text) for name, text in texts.items()}
        if self._faults.arguments("write-refused") & values.keys():
            raise GcsError(Code.HARDWARE)
        for name, value in values.items():
            if not par.acceptable(value, self._memory.defaults[name]):
                raise GcsError(Code.OUT_OF_RANGE)
        lost = self._faults.arguments("write-lost")
        return {name: value for name, value in values.items() if name not in lost}

    def _set_stored(self, words: list[str]) -> None:
        self._need_password(words)
        wanted = self._assignments(words[1:])
        if any(key not in par.NAMES for key in wanted):
            raise GcsError(Code.READ_ONLY)
        self._controller.need_servos_off()
        values = self._accepted({par.NAMES[key]: text for key, text in wanted.items()})
        self._keep(values)

    def _store(self, words: list[str]) -> None:
        self._need_password(words)
        self._controller.need_servos_off()
        self._keep({name: self._memory.active[name] for name in self._names(words[1:])})

    def _keep(self, values: Mapping[str, float]) -> None:
        if "store-refused" in self._faults:
            raise GcsError(Code.EEPROM)
        self._memory.store(values)

    def _names(self, words: list[str]) -> list[str]:
        """Kinematic parameters named, or all of them."""
        return [par.NAMES[key] for key in self._keys(words) if key in par.NAMES]

    def _take(self, names: Sequence[str], source: Mapping[str, float]) -> None:
        """Bring values into use from another memory."""
        self._controller.need_servos_off()
        self._memory.active.update({name: source[name] for name in names})

    def _defaults(self, words: list[str]) -> None:
        self._need_password(words)
        self._take(self._names(words[1:]), self._memory.defaults)

    def _need_password(self, words: list[str]) -> None:
        if not words:
            raise GcsError(Code.SYNTAX)
        if words[0] != STORE_PASSWORD:
            raise GcsError(Code.PASSWORD)

    def _level(self, words: list[str]) -> None:
        if not words or len(words) > 2:
            raise GcsError(Code.SYNTAX)
        level = whole(words[0])
        if level not in (0, ADVANCED):
            raise GcsError(Code.OUT_OF_RANGE)
        if level and words[1:] != [ADVANCED_PASSWORD]:
            raise GcsError(Code.PASSWORD)
        self._controller.level = level
