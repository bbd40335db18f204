"""A machine that is streamed at 1 kHz: what each pose takes, and how much of it the computer adds.

    python -m bench stream [--poses 1000] [--page docs/speed.md]

Along a circle, at 31 mm/s and at 310, the hexapod with its geometry alone and with gravity sag,
cyclic errors and lost motion of every leg: the inverse by itself, each begun at the last; the
trajectory with all effects, pose by pose and in blocks of 50; and ``pkmcal correct --serve`` over
its port, one pose a request and 50. Of each pose the seconds of the processor are told (of the
server's process for the port) and those of the clock. Beside each pose, in turn, a twin takes the
same seconds of the processor and does nothing else (for the port: a server that only answers), so
what other programs on this computer add to both is seen.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from app.jobs.corrector import Corrector
from bench._page_table import load, put, table, today
from bench._stream_twin import burn
from calib.arrays import Array
from calib.command import Surroundings, Trajectory
from calib.command.trajectory import BLOCK
from calib.mechanism.solve import inverse

HIDDEN = {
    "gravity-sag.c": 3e-4,
    "screw-cyclic.period": 5.0,
    **{f"screw-cyclic.leg{leg}.sin": 0.01 for leg in range(1, 7)},
    **{f"backlash.leg{leg}": 0.02 for leg in range(1, 7)},
}
EFFECTS = ("gravity-sag", "screw-cyclic", "backlash")
TOLD = {"payload_kg": 0.0}
RADIUS_MM, AROUND = 10.0, 2000


LIMIT_S = 1e-3
HEAD = (
    "a pose of a stream, ms", "CPU p10", "p50", "p99", "p99.9", "clock p50", "p99", "p99.9",
    "twin p99", "p99.9", "over 1 ms", "twin",
)  # fmt: skip
WORDS = (sys.executable, "-m")


@dataclass(frozen=True, eq=False)
class Latency:
    """Seconds that each pose took: of the processor, by the clock, and its twin by the clock."""

    what: str
    cpu: Array
    clock: Array
    twin: Array

    def cells(self) -> tuple[str, ...]:
        """As a row of the table, ms."""
        parts = [(self.cpu, (0.1, 0.5, 0.99, 0.999)), (self.clock, (0.5, 0.99, 0.999))]
        parts.append((self.twin, (0.99, 0.999)))
        told = [f"{1e3 * q:.3f}" for values, at in parts for q in np.quantile(values, at)]
        late = [f"{100.0 * np.mean(values > LIMIT_S):.1f} %" for values in (self.clock, self.twin)]
        return (self.what, *told, *late)


def circle(count: int, around: int = AROUND) -> Array:
    """Poses (6, count) along a circle of so many, with a turn to and fro."""
    angle = 2.0 * np.pi * np.arange(count) / around
    zero = np.zeros(count)
    x, y = RADIUS_MM * np.sin(angle), RADIUS_MM * np.cos(angle)
    return np.array([x, y, 220.0 + zero, zero, 0.02 * np.sin(angle), zero])


def measured(what: str, calls: Sequence[Callable[[], object]], block: int) -> Latency:
    """Calls in this thread, each its share of a block, the twin after each."""
    cpu, clock, twin = [], [], []
    for call in calls:
        began, used = time.perf_counter(), time.thread_time()
        call()
        used, ended = time.thread_time() - used, time.perf_counter()
        burn(used)
        cpu.append(used)
        clock.append(ended - began)
        twin.append(time.perf_counter() - ended)
    return Latency(what, *(np.array(one) / block for one in (cpu, clock, twin)))


def by_inverse(poses: Array) -> Latency:
    """Geometry alone, as an array call, warm."""
    machine = load_machine("hexapod")
    near = inverse(machine, poses[:, :1])

    def call(k: int) -> None:
        nonlocal near
        near = inverse(machine, poses[:, k : k + 1], None, near)

    calls = [lambda k=k: call(k) for k in range(1, poses.shape[1])]
    return measured("inverse, begun at the last pose", calls, 1)


def by_trajectory(poses: Array, corrector: Corrector, what: str, block: int) -> Latency:
    """All that was found in the command; ``block`` poses at a time, each its share."""
    way, here = Trajectory(corrector.identified), Surroundings(TOLD)
    way.solve(poses[:, :block], here)
    parts = [poses[:, k : k + block] for k in range(block, poses.shape[1] - block + 1, block)]
    calls = [lambda part=part: way.solve(part, here) for part in parts]
    return measured(f"trajectory, {what}, {block} at a time", calls, block)


@contextmanager
def started(words: Sequence[str]) -> Iterator[tuple[int, str]]:
    """A process that prints one line first; its number and that line."""
    with subprocess.Popen(
        [*WORDS, *words], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        try:
            yield process.pid, process.stdout.readline()
        finally:
            process.terminate()


def by_port(poses: Array, model: Path, what: str, block: int) -> Latency:
    """The same through the port; a first hundred poses say how much its twin has to take."""
    count = poses.shape[1] // block
    parts = [poses[:, k * block : (k + 1) * block] for k in range(count)]
    lines = [request(part, block) for part in parts]
    tried = lines[: max(100 // block, 3)]
    with ExitStack() as stack:
        serving = ["pkmcal", "correct", str(model), "--serve", "--json"]
        number, said = stack.enter_context(started(serving))
        wire = stack.enter_context(connected(json.loads(said)["port"]))
        found = [asked(wire, line, number) for line in tried]
        took = float(np.median([cpu for cpu, _, _ in found]))
        words = ["bench._stream_twin", str(took), str(found[-1][2])]
        twin, port = stack.enter_context(started(words))
        other = stack.enter_context(connected(int(port)))
        both = [
            (asked(wire, line, number), asked(other, line, twin)) for line in lines[len(tried) :]
        ]
    cpu, clock = (np.array([own[k] for own, _ in both]) / block for k in (0, 1))
    twin_s = np.array([beside[1] for _, beside in both]) / block
    return Latency(f"correct --serve, {what}, {block} a request", cpu, clock, twin_s)


def connected(port: int) -> socket.socket:
    """A connection that sends at once."""
    wire = socket.create_connection(("127.0.0.1", port))
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return wire


def request(part: Array, block: int) -> bytes:
    """Poses as a line."""
    rows = part.T.tolist()
    said = {"pose": rows[0]} if block == 1 else {"poses": rows}
    return json.dumps({**said, "channels": TOLD}).encode() + b"\n"


def asked(wire: socket.socket, line: bytes, number: int) -> tuple[float, float, int]:
    """Ask: seconds of the server's processor, seconds of the clock, bytes of the answer."""
    used, began = processor_s(number), time.perf_counter()
    wire.sendall(line)
    answer = b""
    while not answer.endswith(b"\n"):
        answer += wire.recv(1 << 16)
    ended = time.perf_counter()
    if not json.loads(answer)["ok"]:
        raise SystemExit(json.loads(answer)["error"])
    return processor_s(number) - used, ended - began, len(answer)


def processor_s(number: int) -> float:
    """Seconds of the processor that a process has taken, by its clock (Linux); else nan."""
    try:
        return time.clock_gettime(~number << 3 | 2)
    except (AttributeError, OSError):
        return float("nan")


def run_of(folder: Path) -> Path:
    """A hexapod that was measured with two payloads, all these effects hidden in it."""
    hidden = [word for name, value in HIDDEN.items() for word in ("--effect", f"{name}={value}")]
    plan = ["--poses", "60", "--seed", "3", "--payload", "0", "--payload", "5"]
    done(["simulate", "hexapod", *plan, *hidden, "--out", str(folder / "run")])
    return folder / "run"


def model_file(run: Path, effects: tuple[str, ...]) -> Path:
    """A model with these effects, fitted and saved."""
    named = [word for name in effects for word in ("--add", name)]
    file = run.parent / f"model-{len(effects)}.toml"
    done(["fit", str(run), *named, "--save", str(file)])
    return file


def done(words: list[str]) -> None:
    """Let ``pkmcal`` do something, quietly."""
    subprocess.run([sys.executable, "-m", "pkmcal", *words], check=True, capture_output=True)


def latencies(count: int) -> Iterator[Latency]:
    """All rows, as they come."""
    slow, fast = circle(count), circle(count, AROUND // 10)
    yield by_inverse(slow)
    with tempfile.TemporaryDirectory() as folder:
        run = run_of(Path(folder))
        alone, whole = model_file(run, ()), model_file(run, EFFECTS)
        kinds = [
            (alone, "geometry alone", slow),
            (whole, "three effects", slow),
            (whole, "three effects, 310 mm/s", fast),
        ]
        for model, what, poses in kinds:
            corrector = Corrector.load(model)
            for block in (1, BLOCK):
                yield by_trajectory(poses, corrector, what, block)
        for model, what, poses in kinds:
            for block in (1, BLOCK):
                yield by_port(poses, model, what, block)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    print(" | ".join(HEAD))
    found = []
    for row in latencies(options.poses):
        found.append(row.cells())
        print(" | ".join(found[-1]), flush=True)
    if options.page is not None:
        said = f"`python -m bench stream`, {today()}; {load()}:"
        put(options.page, "stream", f"{said}\n\n{table(HEAD, found)}")


if __name__ == "__main__":
    main()
