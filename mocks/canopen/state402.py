"""The power state machine of CiA 402 (IEC 61800-7-201), as a table."""

from enum import Enum


class State(Enum):
    """States and their bits 0-3, 5, 6 of the statusword."""

    NOT_READY = 0b000_0000
    SWITCH_ON_DISABLED = 0b100_0000
    READY_TO_SWITCH_ON = 0b010_0001
    SWITCHED_ON = 0b010_0011
    OPERATION_ENABLED = 0b010_0111
    QUICK_STOP_ACTIVE = 0b000_0111
    FAULT = 0b000_1000

    @property
    def bits(self) -> int:
        """Bits of the statusword."""
        return int(self.value)


class Command(Enum):
    """Commands and the controlword bits that make them: (mask, bits)."""

    DISABLE_VOLTAGE = (0b0010, 0b0000)
    QUICK_STOP = (0b0110, 0b0010)
    SHUTDOWN = (0b0111, 0b0110)
    SWITCH_ON = (0b1111, 0b0111)
    ENABLE_OPERATION = (0b1111, 0b1111)

    @classmethod
    def of(cls, controlword: int) -> "Command":
        """Return the command in a controlword; the five cover every word."""
        for command in cls:
            mask, bits = command.value
            if controlword & mask == bits:
                return command
        raise AssertionError(f"0x{controlword:04X}")


_S, _C = State, Command
TRANSITIONS = {
    (_S.SWITCH_ON_DISABLED, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.READY_TO_SWITCH_ON, _C.SWITCH_ON): _S.SWITCHED_ON,
    (_S.READY_TO_SWITCH_ON, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,
    (_S.SWITCHED_ON, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,
    (_S.SWITCHED_ON, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.OPERATION_ENABLED, _C.SWITCH_ON): _S.SWITCHED_ON,
    (_S.OPERATION_ENABLED, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,
    (_S.OPERATION_ENABLED, _C.QUICK_STOP): _S.QUICK_STOP_ACTIVE,
    (_S.QUICK_STOP_ACTIVE, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,
} | {
    (state, command): _S.SWITCH_ON_DISABLED
    for state in (_S.READY_TO_SWITCH_ON, _S.SWITCHED_ON, _S.OPERATION_ENABLED, _S.QUICK_STOP_ACTIVE)
    for command in (_C.DISABLE_VOLTAGE, _C.QUICK_STOP)
    if (state, command)
    not in {(_S.OPERATION_ENABLED, _C.QUICK_STOP), (_S.QUICK_STOP_ACTIVE, _C.QUICK_STOP)}
}


def next_state(state: State, command: Command) -> State:
    """Return the state after ``command``; one that is not allowed changes nothing."""
    return TRANSITIONS.get((state, command), state)
