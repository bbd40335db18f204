"""One line in, its answer out: syntax, dispatch, errors.

Lines of an answer end with " \\n", the last one with "\\n". A line that is refused has no answer;
``ERR?`` says why.
"""

from collections.abc import Callable

from mocks.gcs.controller import AXES, LIMITS, SLIDER_AXES, Controller
from mocks.gcs.errors import Code, GcsError
from mocks.gcs.numbers import flag, real, whole
from mocks.gcs.parameter_commands import ParameterCommands

FIRMWARE = "1.0.0"
# Not plain TRIPOD: PI's client takes a controller of that name for one of GCS 1.
PRODUCT = "PKM-TRIPOD"
STATUS_REGISTER = 1


class CommandSet:
    """The controller's commands."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        about_parameters = ParameterCommands(controller)
        self._queries: dict[str, Callable[[list[str]], list[str]]] = {
            "*IDN?": lambda words: [f"pkmcal mock, {PRODUCT}, {controller.serial}, {FIRMWARE}"],
            "CSV?": lambda words: ["2.0"],
            "ERR?": self._error,
            "SAI?": self._axes,
            "SRG?": self._registers,
            "TMN?": lambda words: self._per_axis(words, lambda axis: LIMITS[axis][0]),
            "TMX?": lambda words: self._per_axis(words, lambda axis: LIMITS[axis][1]),
            "VEL?": self._velocities,
            **{
                query: self._query_of(what)
                for query, what in (
                    ("POS?", "place"),
                    ("MOV?", "target"),
                    ("ONT?", "on_target"),
                    ("SVO?", "servo"),
                    ("FRF?", "referenced"),
                )
            },
            **about_parameters.queries,
        }
        self._commands: dict[str, Callable[[list[str]], None]] = {
            "MOV": lambda words: controller.move(self._assigned(words)),
            "VEL": self._set_velocity,
            "SVO": self._switch,
            "FRF": lambda words: controller.reference(self._named(words) or list(SLIDER_AXES)),
            "STP": lambda words: controller.stop(),
            "HLT": lambda words: controller.stop(),
            **about_parameters.commands,
        }

    def obey(self, line: str) -> str:
        """Carry out one line (without its line feed); returns the answer, "" if there is none."""
        words = line.split()
        if not words:
            return ""
        name, rest = words[0].upper(), words[1:]
        try:
            if name in self._queries:
                return " \n".join(self._queries[name](rest)) + "\n"
            if name not in self._commands:
                raise GcsError(Code.UNKNOWN_COMMAND)
            self._commands[name](rest)
        except GcsError as error:
            self._controller.error = error.code
        return ""

    def _error(self, words: list[str]) -> list[str]:
        code, self._controller.error = int(self._controller.error), 0
        return [str(code)]

    # ------------------------------------------------------------ axes

    def _axes(self, words: list[str]) -> list[str]:
        if words not in ([], ["ALL"]):
            raise GcsError(Code.SYNTAX)
        return list(AXES)

    def _named(self, words: list[str]) -> list[str]:
        for word in words:
            if word not in AXES or len(word) != 1:
                raise GcsError(Code.NO_SUCH_AXIS)
        if len(set(words)) != len(words):
            raise GcsError(Code.AXIS_TWICE)
        return words

    def _assigned(self, words: list[str]) -> dict[str, float]:
        if not words or len(words) % 2:
            raise GcsError(Code.SYNTAX)
        axes = self._named(words[::2])
        return dict(zip(axes, map(real, words[1::2]), strict=True))

    def _per_axis(self, words: list[str], value: Callable[[str], float | bool]) -> list[str]:
        return [f"{axis}={_shown(value(axis))}" for axis in self._named(words) or AXES]

    def _query_of(self, what: str) -> Callable[[list[str]], list[str]]:
        return lambda words: self._per_axis(words, lambda a: self._controller.of_axis(a, what))

    def _velocities(self, words: list[str]) -> list[str]:
        axes = self._named(words) or list(SLIDER_AXES)
        if not set(axes) <= set(SLIDER_AXES):
            raise GcsError(Code.NO_SUCH_AXIS)
        return [f"{axis}={_shown(self._controller.sliders[axis].velocity)}" for axis in axes]

    def _set_velocity(self, words: list[str]) -> None:
        for axis, velocity in self._assigned(words).items():
            self._controller.set_velocity(axis, velocity)

    def _switch(self, words: list[str]) -> None:
        if not words or len(words) % 2:
            raise GcsError(Code.SYNTAX)
        self._controller.switch(self._named(words[::2]), [flag(word) for word in words[1::2]])

    def _registers(self, words: list[str]) -> list[str]:
        if not words:
            words = [word for axis in SLIDER_AXES for word in (axis, str(STATUS_REGISTER))]
        if len(words) % 2:
            raise GcsError(Code.SYNTAX)
        axes = self._named(words[::2])
        if not set(axes) <= set(SLIDER_AXES):
            raise GcsError(Code.NO_SUCH_AXIS)
        if any(whole(number) != STATUS_REGISTER for number in words[1::2]):
            raise GcsError(Code.OUT_OF_RANGE)
        return [f"{a} {STATUS_REGISTER}=0x{self._controller.sliders[a].register():X}" for a in axes]


def _shown(value: float | bool) -> str:
    return str(int(value)) if isinstance(value, bool) else f"{value:.17g}"
