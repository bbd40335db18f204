"""Other ways in which the coordinates of actuators are written: order, signs, zeros."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from calib.look.way import Way
from calib.mechanism.description import Machine
from calib.runs.record import Run

MOST_AXES = 8
"""Actuators up to which signs and exchanges are tried."""


def of_commands(machine: Machine, run: Run) -> Iterator[Way]:
    """Every other way in which people write coordinates of actuators, and actuators that stood."""
    names = [actuator.name for actuator in machine.actuators]
    if len(names) > MOST_AXES:
        return
    home = machine.home_q[:, None]
    turning = [actuator.unit == "rad" for actuator in machine.actuators]
    if len(names) > 3 and len(set(turning)) == 1:  # of fewer it is an exchange
        yield Way(
            "q",
            "the actuators are in reversed order",
            "Write q1 .. qn in the order of the machine file",
            replace(run, q=run.q[::-1].copy()),
        )
    yield Way(
        "q",
        "all of q have the wrong sign",
        "Turn the signs of q round",
        replace(run, q=2.0 * home - run.q),
    )
    for k, name in enumerate(names):
        for mirror, of in ((0.0, "zero"), (2.0 * home[k], "home")):
            q = run.q.copy()
            q[k] = mirror - q[k]
            yield Way(
                "q",
                f"q{k + 1}{_called(name)} has the wrong sign about {of}",
                f"Turn the sign of q{k + 1} round",
                replace(run, q=q),
            )
    for a, b in combinations(range(len(names)), 2):
        if machine.actuators[a].unit == machine.actuators[b].unit:
            q = run.q.copy()
            q[[a, b]] = q[[b, a]]
            yield Way(
                "q",
                f"q{a + 1} and q{b + 1}{_called(names[a], names[b])} are exchanged",
                f"Exchange the columns q{a + 1} and q{b + 1}",
                replace(run, q=q),
            )
    yield from _never_moved(machine, run)
    for k, name in enumerate(names):
        for degrees in (90, -90, 180) if turning[k] else ():
            q = run.q.copy()
            q[k] += np.radians(degrees)
            yield Way(
                "q",
                f"the zero of q{k + 1}{_called(name)} is {-degrees} deg from that of the machine "
                "file",
                f"Add {degrees} deg to q{k + 1}",
                replace(run, q=q),
            )


def _never_moved(machine: Machine, run: Run) -> Iterator[Way]:
    """One actuator stood at home, or where it was first commanded, whatever q says."""
    for k, actuator in enumerate(machine.actuators):
        for place in dict.fromkeys((float(actuator.home), float(run.q[k, 0]))):
            q = run.q.copy()
            q[k] = place
            yield Way(
                "q",
                f"{actuator.name} never moved: it stood at {place:.6g} {actuator.unit} whatever "
                f"q{k + 1} says",
                f"See the drive of {actuator.name} (disabled, clamped, not coupled), and measure "
                "again",
                replace(run, q=q),
            )


def _called(*names: str) -> str:
    """Names of actuators in brackets, where they are not those of their columns."""
    return "" if all(name.startswith("q") for name in names) else f" ({' and '.join(names)})"
