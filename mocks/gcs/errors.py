"""What ``ERR?`` answers: the numbers of PI GCS 2.0 that this controller uses."""

from enum import IntEnum


class Code(IntEnum):
    """Error numbers of the General Command Set."""

    SYNTAX = 1
    UNKNOWN_COMMAND = 2
    NOT_REFERENCED_OR_NO_SERVO = 5
    OUT_OF_LIMITS = 7
    VELOCITY = 8
    STOPPED = 10
    NO_SUCH_AXIS = 15
    OUT_OF_RANGE = 17
    AXIS_TWICE = 22
    MIXED_AXES = 23
    NOT_A_NUMBER = 25
    UNKNOWN_PARAMETER = 54
    PASSWORD = 56
    PROTECTED = 60
    STARTING = 63
    READ_ONLY = 64
    IN_MOTION = 93
    SERVO_ON = 95
    EEPROM = 305
    HARDWARE = 333
    NO_SUCH_SYSTEM = 530
    SYSTEM_IN_USE = 532
    HEXAPOD_IN_MOTION = 536
    NAME_OF_SYSTEM = 557
    MOTION_ERROR = 1024
    FLASH_READ = 4002


class GcsError(Exception):
    """A command that is refused; ``ERR?`` answers ``code`` then."""

    def __init__(self, code: Code) -> None:
        super().__init__(f"{int(code)} {code.name}")
        self.code = code
