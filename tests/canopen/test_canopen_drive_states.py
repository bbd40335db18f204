"""The CiA 402 state machine, as a law over all states and controlwords."""

import pytest

from drivers.canopen.drive402 import NEXT_COMMAND, state_name
from mocks.canopen.state402 import Command, State, next_state

WORDS = range(0x10)


@pytest.mark.parametrize("word", WORDS)
def test_every_controlword_is_exactly_one_command(word: int):
    matching = [c for c in Command if word & c.value[0] == c.value[1]]
    assert matching == [Command.of(word)]


def test_no_command_leaves_fault():
    assert {next_state(State.FAULT, command) for command in Command} == {State.FAULT}


@pytest.mark.parametrize("state", [s for s in State if s not in (State.FAULT, State.NOT_READY)])
def test_the_power_can_be_taken_off_in_every_state(state: State):
    assert next_state(state, Command.DISABLE_VOLTAGE) is State.SWITCH_ON_DISABLED


def test_operation_is_enabled_only_by_its_own_command():
    ways = {
        (state, command)
        for state in State
        for command in Command
        if next_state(state, command) is State.OPERATION_ENABLED
        and state is not State.OPERATION_ENABLED
    }
    assert {command for _, command in ways} == {Command.ENABLE_OPERATION}
    assert State.SWITCH_ON_DISABLED not in {state for state, _ in ways}


def test_quick_stop_ends_motion_everywhere():
    for state in State:
        assert next_state(state, Command.QUICK_STOP) is not State.OPERATION_ENABLED


@pytest.mark.parametrize("state", [s for s in State if s not in (State.FAULT, State.NOT_READY)])
def test_the_driver_s_walk_reaches_operation_enabled(state: State):
    steps = 0
    while state is not State.OPERATION_ENABLED:
        word = NEXT_COMMAND[state_name(state.bits | 1 << 4 | 1 << 9)]
        state = next_state(state, Command.of(word))
        steps += 1
        assert steps <= 4


def test_state_names_do_not_depend_on_the_other_bits():
    for state in State:
        assert state_name(state.bits) == state_name(state.bits | 0xFF90)
