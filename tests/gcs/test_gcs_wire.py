"""Byte by byte: what the mock controller answers to anybody's client."""

import os
import socket
import struct
import time
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from gcs_bench import SmallMachine, running

from mocks.gcs.server import GcsStation
from mocks.physics.truth import machine_file, nominal_parameters

L0, H, THETA = 0x7F010001, 0x7F010002, 0x7F010003


class Client:
    """A bare socket that reads answers as GCS ends them."""

    def __init__(self, station: GcsStation) -> None:
        self.station = station
        self.socket = socket.create_connection(station.address, 5.0)

    def send(self, text: str | bytes) -> None:
        self.socket.sendall(text.encode("cp1252") if isinstance(text, str) else text)

    def answer(self) -> bytes:
        data = b""
        while not data.endswith(b"\n") or data.endswith(b" \n"):
            chunk = self.socket.recv(4096)
            assert chunk, "the controller hung up"
            data += chunk
        return data

    def ask(self, text: str | bytes) -> bytes:
        self.send(text if isinstance(text, bytes) else text + "\n")
        return self.answer()

    def error(self) -> int:
        return int(self.ask("ERR?"))

    def do(self, text: str) -> int:
        """Send a command and return what ERR? answers."""
        self.send(text + "\n")
        return self.error()

    def number(self, query: str) -> float:
        return float(self.ask(query).split(b"=")[1])


@pytest.fixture
def world() -> SmallMachine:
    return SmallMachine()


@pytest.fixture
def client(world: SmallMachine, tmp_path: Path) -> Iterator[Client]:
    with running(GcsStation(world, tmp_path / "nvm.json")) as station:
        made = Client(station)
        yield made
        made.socket.close()


def test_lines_of_an_answer_end_with_a_space_but_the_last(client: Client):
    assert client.ask("SAI?") == b"X \nY \nZ \nA \nB \nC\n"
    assert client.ask("SAI? ALL") == b"X \nY \nZ \nA \nB \nC\n"
    assert client.ask("CSV?") == b"2.0\n"
    assert client.ask("SVO? A B") == b"A=0 \nB=0\n"
    assert client.ask("*IDN?").count(b",") == 3


def test_commands_of_one_byte(client: Client, world: SmallMachine):
    assert client.ask(b"\x05") == b"0\n"
    assert client.ask(b"\x07") == b"\xb1\n"
    client.do("SVO A 1 B 1 C 1")
    client.do("VEL A 0.1")
    client.do("MOV A 400")
    assert client.ask(b"\x05") == b"F\n"  # X, Y, Z and A
    client.send(b"\x18")
    assert client.error() == 10
    assert client.error() == 0


def test_stop_in_the_middle_of_a_line_acts_at_once(client: Client, world: SmallMachine):
    client.do("SVO A 1 B 1 C 1")
    client.do("VEL A 0.1")
    client.do("MOV A 400")
    client.send(b"PO\x18S? A\n")
    assert client.answer().startswith(b"A=4")
    assert client.error() == 10
    deadline = time.monotonic() + 20.0
    while world.moving:
        assert time.monotonic() < deadline


def test_busy_while_referencing(client: Client, world: SmallMachine):
    assert client.do("FRF A") == 5
    client.do("SVO A 1 B 1 C 1")
    client.do("MOV A 400")
    deadline = time.monotonic() + 20.0
    while client.ask("ONT? A") != b"A=1\n":
        assert time.monotonic() < deadline
    client.do("VEL A 0.1")
    assert client.do("FRF A") == 0
    assert client.ask(b"\x07") == b"\xb0\n"
    assert client.ask("FRF? A") == b"A=0\n"


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("NIX", 2),
        ("MOV", 1),
        ("MOV A", 1),
        ("MOV Q 1", 15),
        ("MOV A 400 A 401", 22),
        ("MOV A 400 X 1", 23),
        ("MOV A one", 25),
        ("MOV A nan", 17),
        ("MOV A 500", 7),
        ("MOV Z -20", 7),
        ("MOV A 400", 5),
        ("VEL A 0", 8),
        ("VEL X 1", 15),
        ("SVO A 2", 17),
        ("SPA 1 0x3 4", 54),
        ("SPA 4 0x7F010001 410", 15),
        ("SPA 1 0x7F010001 410.5", 60),
        ("SPA 1 0x7F020001 20", 64),
        ("WPA 101", 56),
        ("DPA 99", 56),
        ("SEP 7 1 0x7F010001 410", 56),
        ("CCL 1 guess", 56),
        ("CCL 7 advanced", 17),
    ],
)
def test_error_codes(client: Client, line: str, code: int):
    assert client.do(line) == code
    assert client.error() == 0, "ERR? reads and clears"


def test_refused_query_has_no_answer_but_a_code(client: Client):
    client.send("SPA? 1 0x3\n")
    assert client.error() == 54


@pytest.mark.parametrize("value", [410.1, 410.0 + 2**-43, 409.99999999999994, 1e-300 + 405.7])
def test_values_read_back_bit_for_bit(client: Client, value: float):
    client.do("CCL 1 advanced")
    assert client.do(f"SPA 2 {L0} {value!r}") == 0  # decimal identifiers are as good
    answer = client.ask(f"SPA? 2 0x{L0:x}")
    assert answer.startswith(b"2 0x7F010001=")
    assert struct.pack("<d", float(answer.split(b"=")[1])) == struct.pack("<d", value)


@pytest.mark.parametrize(
    ("value", "code"), [("nan", 17), ("inf", 17), ("4,1", 25), ("421", 17), ("399", 17)]
)
def test_odd_values_are_refused_whole(client: Client, value: str, code: int):
    client.do("CCL 1 advanced")
    assert client.do(f"SPA 1 {L0} 411 2 {L0} {value}") == code
    assert client.number(f"SPA? 1 {L0}") == 410.0


def test_three_memories(client: Client):
    """RAM, non-volatile memory, defaults: SPA, SEP, WPA, RPA, DPA."""
    ask = client.number
    client.do("CCL 1 advanced")
    client.do(f"SPA 1 {H} 261")
    assert (ask(f"SPA? 1 {H}"), ask(f"SEP? 1 {H}")) == (261.0, 260.0)
    client.do(f"SEP 100 1 {H} 262")
    assert (ask(f"SPA? 1 {H}"), ask(f"SEP? 1 {H}")) == (261.0, 262.0)
    assert client.do("RPA") == 0
    assert ask(f"SPA? 1 {H}") == 262.0
    client.do(f"SPA 1 {H} 263 2 {H} 264")
    assert client.do(f"WPA 100 2 {H}") == 0
    assert (ask(f"SEP? 1 {H}"), ask(f"SEP? 2 {H}")) == (262.0, 264.0)
    assert client.do("DPA 100") == 0
    assert (ask(f"SPA? 1 {H}"), ask(f"SEP? 2 {H}")) == (260.0, 264.0)


def test_nothing_is_written_under_power(client: Client):
    client.do("CCL 1 advanced")
    client.do("SVO B 1")
    for line in (f"SPA 1 {L0} 411", f"SEP 100 1 {L0} 411", "WPA 100", "RPA", "DPA 100"):
        assert client.do(line) == 95
    client.do("SVO B 0")
    assert client.do(f"SPA 1 {L0} 411") == 0


def test_checksum_is_the_documented_one(client: Client):
    nominal = nominal_parameters(machine_file("tripod"))
    names = [f"limb{n}.{what}" for n in (1, 2, 3) for what in ("l0", "h", "theta")]
    crc = zlib.crc32(struct.pack("<9d", *(nominal[name] for name in names)))
    assert int(client.ask("SPA? 1 0x7F030001").split(b"=")[1]) == crc
    assert int(client.ask("SPA? 1 0x7F030002").split(b"=")[1]) == crc


def test_help_names_every_parameter_that_spa_lists(client: Client):
    lines = client.ask("HPA?").split(b" \n")
    entries = {line.split(b"=")[0]: line.split(b"\t") for line in lines if line.startswith(b"0x")}
    listed = [line.split(b"=")[0].split() for line in client.ask("SPA?").split(b" \n")]
    assert {number for _, number in listed} == set(entries)
    assert len(listed) == sum(int(fields[2]) for fields in entries.values())
    assert {fields[3] for fields in entries.values()} == {b"INT", b"FLOAT"}


def test_stored_set_survives_the_power(client: Client):
    client.do("CCL 1 advanced")
    client.do(f"SPA 3 {THETA} 4.19")
    client.do(f"SPA 3 {L0} 411")
    client.do(f"WPA 100 3 {THETA}")
    client.station.power_cycle()
    assert client.number(f"SPA? 3 {THETA}") == 4.19
    assert client.number(f"SPA? 3 {L0}") == 410.0
    assert client.ask("CCL?") == b"0\n"


def test_damaged_memory_starts_with_defaults_and_says_so(client: Client, tmp_path: Path):
    client.do("CCL 1 advanced")
    client.do(f"SPA 1 {L0} 411")
    client.do("WPA 100")
    memory = tmp_path / "nvm.json"
    memory.write_text(memory.read_text().replace("0x1.9b", "0x1.9c"))
    client.station.power_cycle()
    assert client.error() == 4002
    assert client.number(f"SPA? 1 {L0}") == 410.0


def test_garbage_does_no_harm(client: Client):
    client.send(bytes(range(0x80, 0x100)) * 200 + b"\n")
    assert client.error() == 2
    client.send(b"\r\n \n")
    assert client.error() == 0


def test_two_clients_share_one_controller(client: Client):
    other = Client(client.station)
    client.do("SVO A 1")
    assert other.ask("SVO? A") == b"A=1\n"
    other.socket.close()


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo terminals")
def test_serial_line_speaks_the_same(client: Client):
    end = os.open(client.station.pty_path, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(end, b"SAI?\n")
        data = b""
        while not data.endswith(b"C\n"):
            data += os.read(end, 100)
        assert data == b"X \nY \nZ \nA \nB \nC\n"
    finally:
        os.close(end)
