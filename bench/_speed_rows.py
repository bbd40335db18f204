"""Rows of the table of speed: one kind of work, by numpy, by the core, and by a peer."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.files.machines import load_machine
from app.files.runs import read_run
from bench._closed_form_c import ClosedFormInC
from bench._hexapod_closed_form import HexapodClosedForm
from bench.identify import RUN, by_scipy, first_poses
from calib.arrays import Array
from calib.identify import fit
from calib.identify.batch import fit_draws
from calib.mechanism import kernel
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.solve import forward, inverse
from calib.model import Model
from calib.model.many import drawn_readings
from calib.poses import sample_poses
from calib.runs.stack import stack

POSES, DRAWS, ONE_BY_ONE = 1000, 1000, 5


@dataclass(frozen=True)
class Row:
    """Seconds of CPU by numpy (old), by the core (new), by a peer; ``peer_is`` says by which."""

    work: str
    old: float | None
    new: float
    peer: float | None
    peer_is: str
    unit: str = "us"

    def cells(self) -> tuple[str, ...]:
        """Work, old, new, old by new, peer, new by peer, whose."""
        scale = {"us": 1e6, "ms": 1e3, "s": 1.0, "MB": 1.0}[self.unit]

        def told(value: float | None) -> str:
            return "" if value is None else f"{_figures(scale * value)} {self.unit}"

        faster = "" if self.old is None else _figures(self.old / self.new)
        beside = "" if self.peer is None else _figures(self.new / self.peer)
        return (
            self.work, told(self.old), told(self.new), faster, told(self.peer), beside,
            self.peer_is,
        )  # fmt: skip


def _figures(value: float) -> str:
    return f"{value:,.0f}" if value >= 99.5 else f"{value:.2g}"


def best_of(work: Callable[[], object], repeats: int, clock: Callable[[], float]) -> float:
    """Shortest time of a call, s."""
    times = []
    for _ in range(repeats):
        begin = clock()
        work()
        times.append(clock() - begin)
    return min(times)


def cpu(work: Callable[[], object], repeats: int) -> float:
    """Least CPU time of a call, s."""
    work()
    return best_of(work, repeats, time.thread_time)


def both(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """By numpy alone, and with the core."""
    with kernel.reference():
        old = cpu(work, max(1, repeats // 20))
    return old, cpu(work, repeats)


def kinematics() -> Iterator[Row]:
    """One pose alone, batches, derivatives; the peers are a 6-UPS in C and a hexapod in numpy."""
    machine = load_machine("stewart")
    chosen = sample_poses(machine, POSES, np.random.default_rng(1))
    task, extension = np.ascontiguousarray(chosen.task), chosen.configuration.extension
    by_hand, home = ClosedFormInC(machine), np.array(machine.home)
    poses, s = task.T.copy(), extension.T.copy()
    out, begun = np.empty_like(s), np.tile(home, (POSES, 1))
    by_hand.inverse(poses, out)
    agrees(out.T, inverse(machine, task).extension)
    answer = begun.copy()
    by_hand.forward(s, answer)
    agrees(answer.T, forward(machine, extension).poses.to_xyz_rpy())

    def backward() -> None:
        answer[:] = begun
        by_hand.forward(s, answer)

    peers = [cpu(lambda: by_hand.inverse(poses, out), 50) / POSES, cpu(backward, 20) / POSES]
    peer_is = "6-UPS by hand in C, many poses a call"
    first = task[:, :1].copy(), extension[:, :1].copy()
    alone = (lambda: inverse(machine, first[0]), lambda: forward(machine, first[1]))
    many = (lambda: inverse(machine, task), lambda: forward(machine, extension))
    for what, one, batch, peer in zip(("inverse", "forward"), alone, many, peers, strict=True):
        yield Row(f"one pose alone, {what}", *both(one, 200), peer, peer_is)
        old, new = both(batch, 60)
        yield Row(f"{what} in batches, a pose", old / POSES, new / POSES, peer, peer_is)
    yield from derivatives()


def derivatives() -> Iterator[Row]:
    """The hexapod with its arms beside its closed form."""
    machine = load_machine("hexapod")
    chosen = sample_poses(machine, POSES, np.random.default_rng(1))
    at, task = chosen.configuration, np.ascontiguousarray(chosen.task)
    old, new = both(lambda: inverse(machine, task), 100)
    yield Row("hexapod: inverse in batches, a pose", old / POSES, new / POSES, None, "")
    closed = HexapodClosedForm(machine)
    legs = closed.forward(at.extension)
    agrees(legs.position, at.poses.position)
    ours = (lambda: forward(machine, at.extension), lambda: pose_jacobians(machine, at))
    theirs = (lambda: closed.forward(at.extension), lambda: closed.jacobian(legs))
    for what, work, peer in zip(("forward", "Jacobian"), ours, theirs, strict=True):
        old, new = both(work, 60)
        yield Row(
            f"hexapod: {what} in batches, a pose", old / POSES, new / POSES,
            cpu(peer, 10) / POSES, "its closed form by hand in numpy",
        )  # fmt: skip


def agrees(theirs: Array, ours: Array) -> None:
    """A peer that computes something else is none."""
    if not np.allclose(theirs, ours, rtol=0.0, atol=1e-7):
        raise SystemExit(f"a peer is off by {np.abs(theirs - ours).max():.1e}")


def identifications() -> Iterator[Row]:
    """One of 29 poses, and a thousand of the Monte Carlo."""
    loaded = read_run(RUN)
    rows = first_poses(stack(loaded.machine, [loaded.run]), 29)
    peer = cpu(lambda: by_scipy(rows), 1)
    peer_is = "scipy least_squares, 2-point differences, the same residual (numpy)"
    with kernel.reference():
        peer_numpy = best_of(lambda: by_scipy(rows), 1, time.thread_time)
    old, new = both(lambda: fit(Model(rows)), 20)
    yield Row("one identification of 29 poses", old, new, peer_numpy, peer_is, "ms")
    yield Row(
        "the same beside scipy with the core", None, new, peer, "the same with the core", "ms"
    )
    model = Model(rows)
    state = fit(model).linear.state
    _, position = drawn_readings(model, state, [(1, draw) for draw in range(DRAWS)])

    def one_by_one() -> None:
        for draw in range(ONE_BY_ONE):
            fit(Model(replace(model.rows, position=position[:, :, draw])))

    with kernel.reference():
        old = cpu(one_by_one, 1) * DRAWS / ONE_BY_ONE
    new = cpu(lambda: fit_draws(model, position, state), 2)
    yield Row(
        f"1,000 identifications (old: {ONE_BY_ONE} measured, times {DRAWS // ONE_BY_ONE})",
        old, new, peer * DRAWS, "scipy with the core, one measured, times 1,000", "s",
    )  # fmt: skip


def asked(words: list[str], compiled: bool, repeats: int = 1) -> tuple[float, float]:
    """CPU seconds and MB of ``python`` with words: the least of some."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed program is compiled once
    if not compiled:
        environment["PKMCAL_COMPILED"] = "off"
    found = []
    for _ in range(repeats):
        child = subprocess.Popen(
            [sys.executable, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=environment,
        )  # fmt: skip
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise SystemExit(f"{' '.join(words)} ended with {child.returncode}")
        found.append((used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0))
    return min(found)


def verbs(folder: Path) -> Iterator[Row]:
    """Start of a verb, and whole verbs on a thousand poses."""
    peer = asked(["-c", "import numpy, scipy"], True, 3)[0]
    for what, words in (
        ("`pkmcal fit` of an example run, in all", ["-m", "pkmcal", "fit", str(RUN)]),
        ("`pkmcal fit --help`", ["-m", "pkmcal", "fit", "--help"]),
    ):
        old, new = asked(words, False, 3)[0], asked(words, True, 3)[0]
        yield Row(what, old, new, peer, "`import numpy, scipy`", "s")
    yield from monte_carlo()
    run = str(folder / "run")
    hidden = ["--effect", "backlash.leg3=0.015", "--order", "pose-by-pose"]
    asked(
        ["-m", "pkmcal", "simulate", "hexapod", "--poses", str(POSES), *hidden, "--out", run], True
    )
    reading = asked(["-m", "pkmcal", "fit", run], True)
    for verb in ("diagnose", "discover"):
        old, new = (asked(["-m", "pkmcal", verb, run], compiled) for compiled in (False, True))
        what = f"`pkmcal {verb}` on 1,000 poses x 3"
        yield Row(what, old[0], new[0], reading[0], "`pkmcal fit` of the same", "s")
        yield Row(f"{what}, memory", old[1], new[1], reading[1], "`pkmcal fit` of the same", "MB")


def monte_carlo() -> Iterator[Row]:
    """A thousand machines drawn, measured and identified by two processes: CPU of both."""
    words = ["-m", "pkmcal", "identifiability", "hexapod", "--monte-carlo", str(DRAWS)]
    old, new = (asked([*words, "--workers", "2"], compiled)[0] for compiled in (False, True))
    one = asked([*words, "--workers", "1"], True)[0]
    yield Row(
        f"`pkmcal identifiability --monte-carlo {DRAWS}`, two processes, CPU of both",
        old, new, one, "the same by one process", "s",
    )  # fmt: skip
