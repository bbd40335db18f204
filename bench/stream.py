"""A machine that is streamed at 1 kHz: what each pose takes, as p50, p99 and the longest.

    python -m bench stream [--poses 2000]

Along a circle, 0.03 mm a step, the hexapod with its geometry alone and with gravity sag, cyclic
errors and lost motion of every leg: the inverse by itself, each begun at the last; the trajectory
with all effects, pose by pose and in blocks of 50; and ``pkmcal correct --serve`` over its port,
one pose a request and 50. By the clock of this thread, but for the port, which is by the wall's.
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
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from app.jobs.corrector import Corrector
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


@dataclass(frozen=True)
class Latency:
    """What one pose takes, ms."""

    what: str
    p50: float
    p99: float
    longest: float

    @classmethod
    def of(cls, what: str, seconds: Iterable[float]) -> "Latency":
        """Of measured times."""
        ms = 1e3 * np.array(list(seconds))
        return cls(what, float(np.median(ms)), float(np.quantile(ms, 0.99)), float(ms.max()))

    def __str__(self) -> str:
        return f"{self.what:52s} {self.p50:7.3f} {self.p99:7.3f} {self.longest:7.3f}"


def circle(count: int) -> Array:
    """Poses (6, count) along a circle, with a turn to and fro."""
    angle = 2.0 * np.pi * np.arange(count) / AROUND
    zero = np.zeros(count)
    x, y = RADIUS_MM * np.sin(angle), RADIUS_MM * np.cos(angle)
    return np.array([x, y, 220.0 + zero, zero, 0.02 * np.sin(angle), zero])


def taken(calls: Iterable[Callable[[], object]], clock: Callable[[], float]) -> list[float]:
    """Seconds of each call."""
    found = []
    for call in calls:
        begin = clock()
        call()
        found.append(clock() - begin)
    return found


def by_inverse(poses: Array) -> Latency:
    """Geometry alone, as an array call, warm."""
    machine = load_machine("hexapod")
    near = inverse(machine, poses[:, :1])
    found = []
    for k in range(poses.shape[1]):
        begin = time.thread_time()
        near = inverse(machine, poses[:, k : k + 1], None, near)
        found.append(time.thread_time() - begin)
    return Latency.of("inverse, begun at the last pose", found)


def by_trajectory(poses: Array, corrector: Corrector, what: str, block: int) -> Latency:
    """All that was found in the command; ``block`` poses at a time, each its share."""
    way, here = Trajectory(corrector.identified), Surroundings(TOLD)
    way.solve(poses[:, :block], here)
    parts = [poses[:, k : k + block] for k in range(block, poses.shape[1] - block + 1, block)]
    calls = [lambda part=part: way.solve(part, here) for part in parts]
    seconds = np.repeat(np.array(taken(calls, time.thread_time)) / block, block)
    return Latency.of(f"trajectory, {what}, {block} at a time", seconds)


def by_port(poses: Array, model: Path, what: str, block: int) -> Latency:
    """The same through the port, by the wall's clock."""
    command = [sys.executable, "-m", "pkmcal", "correct", str(model), "--serve", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        port = json.loads(process.stdout.readline())["port"]
        try:
            with socket.create_connection(("127.0.0.1", port)) as wire:
                seconds = asked(wire, poses, block)
        finally:
            process.terminate()
    each = np.repeat(np.array(seconds) / block, block)
    return Latency.of(f"correct --serve, {what}, {block} a request", each)


def asked(wire: socket.socket, poses: Array, block: int) -> list[float]:
    """Seconds of each request."""
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    with wire.makefile("rb") as lines:

        def ask(part: Array) -> None:
            rows = part.T.tolist()
            said = {"pose": rows[0]} if block == 1 else {"poses": rows}
            wire.sendall(json.dumps({**said, "channels": TOLD}).encode() + b"\n")
            answer = json.loads(lines.readline())
            if not answer["ok"]:
                raise SystemExit(answer["error"])

        ask(poses[:, :block])
        parts = [poses[:, k : k + block] for k in range(block, poses.shape[1], block)]
        return taken((lambda part=part: ask(part) for part in parts), time.perf_counter)


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


def measured(count: int) -> list[Latency]:
    """All rows."""
    poses = circle(count)
    found = [by_inverse(poses)]
    with tempfile.TemporaryDirectory() as folder:
        run = run_of(Path(folder))
        models = {
            "geometry alone": model_file(run, ()),
            "three effects": model_file(run, EFFECTS),
        }
        for what, model in models.items():
            corrector = Corrector.load(model)
            found += [
                by_trajectory(
                    poses[:, : count if block > 1 else count // 4], corrector, what, block
                )
                for block in (1, BLOCK)
            ]
        for what, model in models.items():
            found += [
                by_port(poses[:, : count if block > 1 else count // 4], model, what, block)
                for block in (1, BLOCK)
            ]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=2000)
    options = parser.parse_args()
    print(f"{'ms a pose':52s} {'p50':>7s} {'p99':>7s} {'longest':>7s}")
    for row in measured(options.poses):
        print(row, flush=True)


if __name__ == "__main__":
    main()
