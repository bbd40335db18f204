"""`pkmcal correct --serve`: whatever a client sends, it gets an answer, and so do the others."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

import pkmcal

POSE = [0, 0, 220, 0, 0, 0]


class Client:
    """One connection: a line out, a line back."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=60.0)
        self._file = self._socket.makefile("rb")

    def raw(self, data: bytes) -> dict:
        self._socket.sendall(data)
        return self.next()

    def next(self) -> dict:
        return json.loads(self._file.readline())

    def ask(self, **request: object) -> dict:
        return self.raw(json.dumps(request).encode() + b"\n")

    def close(self) -> None:
        self._file.close()
        self._socket.close()


@pytest.fixture(scope="module")
def served(model: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    process = subprocess.Popen(
        [sys.executable, "-m", "pkmcal", "correct", str(model), "--serve", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert process.stdout is not None
    said = json.loads(process.stdout.readline())
    assert said["host"] == "127.0.0.1"
    yield process, said["port"]
    process.kill()
    process.wait()
    process.stdout.close()


@pytest.fixture
def client(served: tuple[object, int]) -> Iterator[Client]:
    made = Client(served[1])
    yield made
    made.close()


def test_served_answers_are_those_of_the_verb(client: Client, model: Path) -> None:
    found = client.ask(pose=POSE, channels={"payload_kg": 2.5}, id="first")
    assert (found["ok"], found["id"]) == (True, "first")
    same = pkmcal.correct(model, [POSE], payload=2.5).poses[0]
    assert found["q"] == pytest.approx(list(same.q), abs=1e-8)
    assert found["pose"] == pytest.approx(list(same.pose), abs=1e-8)
    about = client.ask(do="about")
    assert about["effects"] == ["gravity-sag", "backlash"]
    assert set(about["measured"]["task"]) == {"x", "y", "z", "rx", "ry", "rz"}


def test_every_client_has_a_history_of_its_own(served: tuple[object, int]) -> None:
    one, other = Client(served[1]), Client(served[1])
    load = {"payload_kg": 2.5}
    first = one.ask(pose=POSE, channels=load)["q"]
    one.ask(pose=[0, 0, 225, 0, 0, 0], channels=load)
    assert one.ask(pose=POSE, channels=load, keep=False)["q"] != pytest.approx(first, abs=1e-4)
    assert other.ask(pose=POSE, channels=load)["q"] == pytest.approx(first, abs=1e-8)
    assert one.ask(do="forget") == {"ok": True}
    assert one.ask(pose=POSE, channels=load)["q"] == pytest.approx(first, abs=1e-8)
    one.close()
    other.close()


@pytest.mark.parametrize(
    ("line", "kind", "words"),
    [
        (b"hello\n", "input", "not JSON"),
        (b"\xff\xfe\n", "input", "not JSON"),
        (b"[1, 2]\n", "input", "not a JSON object"),
        (b"[" * 5000 + b"\n", "input", "not JSON"),
        (b'{"do": "move"}\n', "input", "Ask for correct"),
        (b'{"pose": [1, 2]}\n', "input", "2 numbers are no pose"),
        (b'{"pose": [0, 0, 220, 0, 0, NaN]}\n', "input", "no finite number"),
        (b'{"pose": [0, 0, 1e300, 0, 0, 0]}\n', "input", "no finite number"),
        (b'{"pose": [0, 0, ' + b"9" * 600 + b", 0, 0, 0]}\n", "input", "no finite number"),
        (b'{"pose": {"x": 1}}\n', "input", "the pose has no y"),
        (b'{"pose": [0, 0, 220, 0, 0, 0]}\n', "input", "payload_kg"),
        (b'{"pose": [0, 0, 220, 0, 0, 0], "load": 3}\n', "input", "unknown key"),
        (b'{"pose": [0, 0, 220, 0, 0, 0], "channels": [3]}\n', "input", "channels is no object"),
        (b'{"pose": [0,0,220,0,0,0], "channels": {"payload_kg": "5"}}\n', "input", "no finite"),
        (b'{"pose": [0,0,246,0,0,0], "channels": {"payload_kg": 1}}\n', "region", "mm beyond"),
        (b'{"pose": [9e8,0,2,0,0,0], "channels": {"payload_kg": 1}}\n', "input", "the pose: it"),
        (b'{"pose": [0,0,220,0,0,0], "keep": 1}\n', "input", "true or false"),
        (b"x" * 70_000 + b"\n", "input", "longer than"),
        (b"x" * 400_000 + b"\n", "input", "longer than"),
    ],
)
def test_what_is_wrong_is_answered_and_the_connection_stays(
    client: Client, line: bytes, kind: str, words: str
) -> None:
    found = client.raw(line)
    assert found["ok"] is False
    assert found["kind"] == kind
    assert words in found["error"]
    assert client.ask(do="forget") == {"ok": True}


def test_lines_in_pieces_and_several_at_once_are_answered_in_order(client: Client) -> None:
    request = json.dumps({"do": "forget", "id": 1}).encode()
    client._socket.sendall(request[:7])
    assert client.raw(request[7:] + b"\n")["id"] == 1
    many = b"".join(json.dumps({"do": "forget", "id": k}).encode() + b"\n\n" for k in range(20))
    found = [client.raw(many), *(client.next() for _ in range(19))]
    assert [one["id"] for one in found] == list(range(20))


def _joined(port: int) -> Client:
    """A client that was let in, at the latest when the server has seen that others are gone."""
    deadline = time.monotonic() + 60.0
    while True:
        one = Client(port)
        with suppress(ConnectionError, ValueError):  # turned away, perhaps before it was heard
            if one.ask(do="forget")["ok"]:
                return one
        one.close()
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_clients_that_vanish_or_are_too_many_leave_the_others_alone(
    served: tuple[object, int], client: Client
) -> None:
    gone = socket.create_connection(("127.0.0.1", served[1]))
    gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
    gone.sendall(b'{"do": "about"}\n' * 50 + b'{"do"')
    gone.close()
    assert client.ask(do="forget") == {"ok": True}
    crowd = [_joined(served[1]) for _ in range(31)]
    late = Client(served[1])
    assert "clients already" in late.next()["error"]
    for one in (*crowd, late):
        one.close()
    assert client.ask(do="forget") == {"ok": True}


@pytest.mark.long
def test_a_port_that_is_taken_is_bad_input(served: tuple[object, int], model: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pkmcal", "correct", str(model), "--serve", str(served[1])],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "cannot be used" in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot send SIGTERM to a process")
def test_served_poses_together_are_those_one_by_one(client: Client) -> None:
    told = {"payload_kg": 2.5}
    poses = [[x, 0.5 * x, 220, 0, 0.01, 0] for x in (0.0, 4.0, 9.0, 7.0)]
    one_by_one = [client.ask(pose=pose, channels=told)["q"] for pose in poses]
    assert client.ask(do="forget")["ok"]
    together = client.ask(poses=poses, channels=told)
    assert together["ok"]
    for one, entry in zip(one_by_one, together["poses"], strict=True):
        assert entry["q"] == pytest.approx(one, abs=1e-6)


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        ({"poses": []}, "poses is no list"),
        ({"poses": [POSE], "pose": POSE}, "pose is there too"),
        ({"poses": [POSE, [0, 0, 900, 0, 0, 0]]}, "pose 2: it passes a limit"),
        ({"poses": [POSE, POSE], "time_s": [1.0]}, "time_s has 1 numbers"),
        ({"poses": [POSE, POSE], "time_s": [1.0, None]}, "time_s: None is no finite number"),
    ],
)
def test_served_poses_that_cannot_be_are_refused(client: Client, request_: dict, says: str) -> None:
    found = client.ask(**request_, channels={"payload_kg": 2.5})
    assert not found["ok"]
    assert says in found["error"]


def test_sigterm_ends_it_with_clients_there(served: tuple[subprocess.Popen[str], int]) -> None:
    process, port = served
    there = Client(port)
    assert there.ask(do="forget") == {"ok": True}
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=60.0) == 0
    assert there._file.readline() == b""
    there.close()
