"""The commands of a closed hexapod's controller: one line in, its answer out.

Numbers are answered with ten decimals, as such a controller rounds them; a line that is refused
has no answer, and ``ERR?`` says why, once.
"""

from collections.abc import Callable

from mocks.gcs.errors import Code, GcsError
from mocks.gcs.hexapod_controller import AXES, LIMITS, HexapodController
from mocks.gcs.hexapod_frames import OWN_TYPE
from mocks.gcs.numbers import flag, real

FIRMWARE = "1.0.0"
# Not plain HEXAPOD: PI's client takes a controller of that name for one of GCS 1.
PRODUCT = "PKM-HEXAPOD"
PIVOT = "RST"
ALWAYS = ("*IDN?", "ERR?", "CSV?", "HLP?", "SAI?")
SINGLE_BYTES = {"#5": "Request Motion Status", "#7": "Request Controller Ready Status",
                "#24": "Stop All Axes"}  # fmt: skip


class HexapodCommands:
    """Carries them out."""

    def __init__(self, controller: HexapodController) -> None:
        self._controller = c = controller
        self._queries: dict[str, Callable[[list[str]], list[str]]] = {
            "*IDN?": lambda words: [f"pkmcal mock, {PRODUCT}, {c.serial}, {FIRMWARE}"],
            "CSV?": lambda words: ["2.0"],
            "ERR?": self._error,
            "FRF?": lambda words: self._flags(words, c.referenced),
            "HLP?": self._help,
            "KEN?": lambda words: [f"{n}={kind}" for n, kind in c.systems.enabled().items()],
            "KLS?": lambda words: self._systems(),
            "MOV?": lambda words: self._six(words, c.target()),
            "ONT?": lambda words: self._flags(words, c.on_target),
            "POS?": lambda words: self._six(words, c.place()),
            "PUN?": lambda words: [f"{a}={'MM' if a in 'XYZ' else 'DEG'}" for a in _named(words)],
            "SAI?": self._axes,
            "SPI?": lambda words: [f"{a}={_shown(c.systems.pivot[a])}" for a in _pivot(words)],
            "SVO?": lambda words: self._flags(words, c.servo),
            "TMN?": lambda words: [f"{a}={_shown(LIMITS[a][0])}" for a in _named(words)],
            "TMX?": lambda words: [f"{a}={_shown(LIMITS[a][1])}" for a in _named(words)],
            "VLS?": lambda words: [_shown(c.velocity)],
            "VMO?": lambda words: [str(int(c.can_go(_assigned(words, AXES))))],
        }
        self._commands: dict[str, Callable[[list[str]], None]] = {
            "FRF": lambda words: self._reference(words),
            "HLT": lambda words: c.stop(),
            "KEN": self._enable,
            "KSD": self._define,
            "MOV": lambda words: c.move(_assigned(words, AXES)),
            "SPI": self._set_pivot,
            "STP": lambda words: c.stop(),
            "SVO": self._switch,
            "VLS": self._set_velocity,
        }

    def obey(self, line: str) -> str:
        """Carry out one line (without its line feed); returns the answer, "" if there is none."""
        words = line.split()
        if not words:
            return ""
        name, rest = words[0].upper(), words[1:]
        try:
            if self._controller.booting and name not in ALWAYS:
                raise GcsError(Code.STARTING)
            if name in self._queries:
                return " \n".join(self._queries[name](rest)) + "\n"
            if name not in self._commands:
                raise GcsError(Code.UNKNOWN_COMMAND)
            self._commands[name](rest)
        except GcsError as error:
            self._controller.error = error.code
        return ""

    # ------------------------------------------------------------ answers

    def _error(self, words: list[str]) -> list[str]:
        code, self._controller.error = int(self._controller.error), 0
        return [str(code)]

    def _help(self, words: list[str]) -> list[str]:
        lines = [f"{byte} {says}" for byte, says in SINGLE_BYTES.items()]
        lines += [f"{name} {SAYS[name]}" for name in sorted({*self._queries, *self._commands})]
        return ["The following commands are valid:", *lines, "end of help"]

    def _axes(self, words: list[str]) -> list[str]:
        if words not in ([], ["ALL"]):
            raise GcsError(Code.SYNTAX)
        return list(AXES)

    def _flags(self, words: list[str], value: bool) -> list[str]:
        return [f"{axis}={int(value)}" for axis in _named(words)]

    def _six(self, words: list[str], values: tuple[float, ...]) -> list[str]:
        by_axis = dict(zip(AXES, values, strict=True))
        return [f"{axis}={_shown(by_axis[axis])}" for axis in _named(words)]

    def _systems(self) -> list[str]:
        systems = self._controller.systems
        lines = [
            "\t".join([f"Name={name}", f"Type={OWN_TYPE}",
                       *(f"{a}={_shown(v)}" for a, v in zip(AXES, offsets, strict=True))])
            for name, offsets in systems.defined.items()
        ]  # fmt: skip
        return ["Name=ZERO\tType=ROOT", *lines]

    # ------------------------------------------------------------ commands

    def _reference(self, words: list[str]) -> None:
        _named(words)
        self._controller.reference()

    def _switch(self, words: list[str]) -> None:
        if not words or len(words) % 2:
            raise GcsError(Code.SYNTAX)
        _named(words[::2])
        states = [flag(word) for word in words[1::2]]
        self._controller.switch(any(states))

    def _set_velocity(self, words: list[str]) -> None:
        if len(words) != 1:
            raise GcsError(Code.SYNTAX)
        self._controller.set_velocity(real(words[0]))

    def _set_pivot(self, words: list[str]) -> None:
        values = _assigned(words, PIVOT)
        self._controller.need_rest()
        self._controller.systems.pivot.update(values)

    def _define(self, words: list[str]) -> None:
        if not words:
            raise GcsError(Code.SYNTAX)
        offsets = _assigned(words[1:], AXES) if words[1:] else {}
        self._controller.systems.define(words[0].upper(), offsets, AXES)

    def _enable(self, words: list[str]) -> None:
        if len(words) != 1:
            raise GcsError(Code.SYNTAX)
        self._controller.need_rest()
        self._controller.systems.enable(words[0].upper())


def _named(words: list[str]) -> list[str]:
    return _among(words, AXES)


def _pivot(words: list[str]) -> list[str]:
    return _among(words, PIVOT)


def _among(words: list[str], axes: str) -> list[str]:
    if any(word not in axes or len(word) != 1 for word in words):
        raise GcsError(Code.NO_SUCH_AXIS)
    if len(set(words)) != len(words):
        raise GcsError(Code.AXIS_TWICE)
    return words or list(axes)


def _assigned(words: list[str], axes: str) -> dict[str, float]:
    if not words or len(words) % 2:
        raise GcsError(Code.SYNTAX)
    return dict(zip(_among(words[::2], axes), map(real, words[1::2]), strict=True))


def _shown(value: float) -> str:
    return f"{value:.10f}"


SAYS = {
    "*IDN?": "Get Device Identification", "CSV?": "Get Current Syntax Version",
    "ERR?": "Get Error Number", "FRF": "[{<AxisID>}] Reference Move",
    "FRF?": "[{<AxisID>}] Get Referencing Result", "HLP?": "Get List of Available Commands",
    "HLT": "[{<AxisID>}] Halt Motion", "KEN": "<CSName> Enable Coordinate System",
    "KEN?": "Get Enabled Coordinate Systems", "KLS?": "Get Properties of Coordinate Systems",
    "KSD": "<CSName> [{<AxisID> <Value>}] Define Coordinate System",
    "MOV": "{<AxisID> <Position>} Set Target Position",
    "MOV?": "[{<AxisID>}] Get Target Position", "ONT?": "[{<AxisID>}] Get On-Target State",
    "POS?": "[{<AxisID>}] Get Position", "PUN?": "[{<AxisID>}] Get Position Unit",
    "SAI?": "[ALL] Get Axis Identifiers", "SPI": "{<PPCoordinate> <Value>} Set Pivot Point",
    "SPI?": "[{<PPCoordinate>}] Get Pivot Point", "STP": "Stop All Axes",
    "SVO": "{<AxisID> <State>} Set Servo Mode", "SVO?": "[{<AxisID>}] Get Servo Mode",
    "TMN?": "[{<AxisID>}] Get Minimum Position", "TMX?": "[{<AxisID>}] Get Maximum Position",
    "VLS": "<Velocity> Set System Velocity", "VLS?": "Get System Velocity",
    "VMO?": "{<AxisID> <Position>} Check Whether Motion Is Possible",
}  # fmt: skip
