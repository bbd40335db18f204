"""The slcan adapter: text that real adapters speak, on a real socket."""

import socket
import threading
from collections.abc import Iterator

import pytest
from canopen_bench import until
from hypothesis import given
from hypothesis import strategies as st

from mocks.canopen.slcan import Frame, SlcanEndpoint, decode, encode

frames = st.one_of(
    st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8)),
    st.builds(Frame, st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8), st.just(True)),
)


@given(frames)
def test_decode_is_the_inverse_of_encode(frame: Frame):
    assert decode(encode(frame)[:-1]) == frame


def test_lines_are_those_of_the_lawicel_manual():
    assert encode(Frame(0x10, b"\x11\x22")) == b"t01021122\r"
    assert encode(Frame(0x100, b"", True)) == b"T000001000\r"
    assert decode(b"r1003") == Frame(0x100, bytes(3), remote=True)


@pytest.mark.parametrize(
    "line", [b"t", b"t10", b"txyz0", b"t1009", b"t1002AA", b"t1001AAA", b"t8000", b"t1001G0"]
)
def test_broken_lines_are_no_frames(line: bytes):
    with pytest.raises((ValueError, IndexError)):
        decode(line)


class Terminal:
    """A raw client."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.socket = socket.create_connection(address, 2.0)

    def ask(self, line: bytes, answer_bytes: int = 1) -> bytes:
        self.socket.sendall(line)
        return self.read(answer_bytes)

    def read(self, count: int) -> bytes:
        data = b""
        while len(data) < count and (part := self.socket.recv(count - len(data))):
            data += part
        return data


@pytest.fixture
def received() -> list[Frame]:
    return []


@pytest.fixture
def endpoint(received: list[Frame]) -> Iterator[SlcanEndpoint]:
    endpoint = SlcanEndpoint(received.append, "127.0.0.1", 0)
    endpoint.start()
    yield endpoint
    endpoint.stop()


@pytest.fixture
def terminal(endpoint: SlcanEndpoint) -> Iterator[Terminal]:
    terminal = Terminal(endpoint.address)
    yield terminal
    terminal.socket.close()


def test_channel_is_opened_once_and_closed(terminal: Terminal):
    asked = [terminal.ask(line) for line in (b"S6\r", b"O\r", b"O\r", b"S6\r", b"C\r", b"C\r")]
    assert asked == [b"\r", b"\r", b"\a", b"\a", b"\r", b"\r"]


def test_frames_need_an_open_channel(terminal: Terminal, received: list[Frame]):
    assert terminal.ask(b"t1230\r") == b"\a"
    assert terminal.ask(b"O\rt12301\r", 2) == b"\r\a"
    assert terminal.ask(b"t12311F\r") == b"\r"
    assert received == [Frame(0x123, b"\x1f")]


def test_listening_channel_sends_nothing(terminal: Terminal, received: list[Frame]):
    assert terminal.ask(b"L\r") == b"\r"
    assert terminal.ask(b"t1230\r") == b"\a"
    assert received == []


def test_version_serial_flags_and_nonsense(terminal: Terminal):
    assert terminal.ask(b"V\r", 6) == b"V1013\r"
    assert terminal.ask(b"N\r", 6) == b"NPKM1\r"
    assert terminal.ask(b"F\r") == b"\a"
    assert terminal.ask(b"q\r") == b"\a"
    assert terminal.ask(b"S99\r") == b"\a"
    assert terminal.ask(b"x" * 100) == b"\a"


def test_line_may_come_in_pieces(terminal: Terminal, received: list[Frame]):
    assert terminal.ask(b"O\r") == b"\r"
    terminal.socket.sendall(b"t123")
    terminal.socket.sendall(b"1A")
    assert terminal.ask(b"B\r") == b"\r"
    assert received == [Frame(0x123, b"\xab")]


def test_clients_hear_one_another_and_the_bus(endpoint: SlcanEndpoint, terminal: Terminal):
    other = Terminal(endpoint.address)
    assert terminal.ask(b"O\r") == other.ask(b"O\r") == b"\r"
    assert other.ask(b"t7010\r") == b"\r"
    assert terminal.read(6) == b"t7010\r"
    endpoint.broadcast(Frame(0x181, b"\x01"))
    assert terminal.read(8) == other.read(8) == b"t181101\r"
    other.socket.close()


def test_cut_ends_every_connection(endpoint: SlcanEndpoint, terminal: Terminal):
    terminal.ask(b"O\r")
    endpoint.cut()
    assert terminal.read(1) == b""


def test_reset_is_seen_as_a_reset(endpoint: SlcanEndpoint, terminal: Terminal):
    terminal.ask(b"O\r")
    endpoint.cut(reset=True)
    with pytest.raises(ConnectionResetError):
        terminal.read(1)


async def test_what_a_client_has_sent_is_no_silence_while_it_waits_to_be_taken_in() -> None:
    taken = threading.Event()
    endpoint = SlcanEndpoint(lambda _frame: taken.wait(10.0) and None, "127.0.0.1", 0)
    endpoint.start()
    try:
        assert not endpoint.behind
        with socket.create_connection(endpoint.address) as client:
            client.sendall(b"O\rt701105\r")
            await until(lambda: endpoint.behind)
            taken.set()
            await until(lambda: not endpoint.behind)
    finally:
        taken.set()
        endpoint.stop()
