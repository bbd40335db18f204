"""Seventeen runs once explained away, each by the name of its case, with the right answer.

Each is made from a clean simulated hexapod: labels, units, readings and frames spoilt as people
spoil them, machines with one effect more, noise that follows itself.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from bench.mistakes import labels, motion, readings, units
from bench.mistakes.clean import clean_run, machine_named, moved_by
from calib.discover.discovery import Refitter, discover_run
from calib.discover.report import discovery_report
from calib.effects import catalogue
from calib.look import first_look
from calib.runs.record import Run
from mocks.simulate.plan import Profile

pytestmark = pytest.mark.long

SIGMA_MM = 0.005
HEAVY = Profile(rise_K=8.0, payload_kg=(0.0, 12.0))
SAG = {"gravity-sag.c": 2e-4}
BACKLASH = {"backlash.leg3": 0.02}
STICK = {f"stick-slip.leg{k}": 0.025 for k in range(1, 7)} | {"stick-slip.reach": 4.0}
WARM = {"warm-up.A": 0.12, "warm-up.tau": 150.0}
HEAT = {"screw-twist.L": 2.0, "thermal-growth.a": 3e-5}
Make = Callable[[Run], Run]


def by(mistake: Callable[[Run, np.random.Generator], Run]) -> Make:
    return lambda run: mistake(run, np.random.default_rng(2))


def late(run: Run) -> Run:
    """The station moves by 16 mm after 85 % of the readings."""
    read = np.flatnonzero(run.measured)
    which = np.isin(np.arange(run.line.size), read[int(0.85 * read.size) :])
    return moved_by(run, which, 16.0, np.random.default_rng(2))


def hum(run: Run) -> Run:
    """Dwells average 49.98 Hz to a period of 50 s, along one direction of the tracker."""
    wave = 0.008 * np.sin(2.0 * np.pi * 49.98 * run.time_s)
    return replace(run, position=run.position + np.outer([0.6, 0.0, 0.8], wave))


def correlated(rho: float) -> Make:
    """Readings without noise get noise that follows itself from reading to reading."""

    def make(run: Run) -> Run:
        noise = np.random.default_rng(5).standard_normal(run.position.shape)
        for k in range(1, noise.shape[1]):
            noise[:, k] = rho * noise[:, k - 1] + np.sqrt(1.0 - rho**2) * noise[:, k]
        exact = np.eye(3)[:, :, None] * SIGMA_MM**2 * np.ones(run.line.size)
        return replace(run, position=run.position + SIGMA_MM * noise, covariance=exact)

    return make


@dataclass(frozen=True)
class Case:
    """A clean run with ``hidden`` in it, and what is done to it; then what is to be answered."""

    hidden: Mapping[str, float] = field(default_factory=dict)
    make: Make = lambda run: run
    record: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    adequate: bool = True
    told: str = "othing"
    noise: str = ""
    poses: int = 20
    profile: Profile = HEAVY
    exact: bool = False


CASES = {
    "correlated-noise-02": Case(
        make=correlated(0.2), noise="the noise is correlated over", poses=60, exact=True
    ),
    "correlated-noise-05": Case(
        make=correlated(0.5), noise="the noise is correlated over", poses=30, exact=True
    ),
    "nests-exchanged": Case(
        BACKLASH, by(labels.nests_exchanged), ("nests-exchanged",), ("backlash",)
    ),
    "nests-mirrored": Case(make=by(labels.mirrored(0)), record=("nests-mirrored",)),
    "tracker-azimuth-encoder": Case(
        {"tracker-encoder.azimuth.sin": 1.5e-4}, effects=("tracker-encoder",)
    ),
    "count-slip-of-one-leg": Case(
        {"actuator-step.leg4": 0.03, "actuator-step.t0": 300.0},
        record=("actuator-slipped",),
        effects=("actuator-step",),
    ),
    "stick-slip": Case(STICK, effects=("stick-slip",)),
    "warm-up-creep": Case(WARM, effects=("warm-up",)),
    "hum": Case(
        make=hum, adequate=False, told="it is periodic in time, with a period of 50", poses=30
    ),
    "temperature-in-kelvin": Case(
        HEAT,
        by(units.temperature(lambda v: v + 273.15)),
        ("temperature-in-kelvin",),
        ("screw-twist", "thermal-growth"),
    ),
    "gravity-points-up": Case(
        SAG,
        by(units.gravity(lambda g: -g)),
        ("sign-impossible",),
        ("gravity-sag",),
        adequate=False,
        told="is the wrong way round",
    ),
    "payload-in-grams": Case(
        SAG,
        by(units.payload_times(1000.0)),
        ("payload-in-grams", "size-impossible"),
        ("gravity-sag",),
        adequate=False,
        told="payload_kg looks like grams",
    ),
    "tracker-moved-late": Case(BACKLASH, late, ("station-moved",), ("frame-shift", "backlash")),
    "tracker-moved-30-mm": Case(
        make=by(motion.moved(30.0, 30.0, 0.5, 0.5)),
        record=("station-moved",),
        effects=("frame-shift",),
    ),
    "stale-readings": Case(make=by(readings.stale), record=("stale-readings",)),
    "wrong-size-smr": Case(make=by(motion.other_smr(2.0, 2.0)), record=("smr-size",)),
    "zeros-at-the-start": Case(make=by(readings.zeros_at_the_start), record=("zero-readings",)),
}


def answered(case: Case) -> dict[str, Any]:
    clean = clean_run(
        "hexapod", 7, poses=case.poses, hidden=case.hidden, profile=case.profile,
        noise_mm=1e-6 if case.exact else SIGMA_MM,
    )  # fmt: skip
    machine = machine_named("hexapod")
    rows = first_look(machine, [case.make(clean)])
    return discovery_report(discover_run(Refitter(rows, catalogue(machine))))


@pytest.mark.parametrize("name", CASES)
def test_a_case_has_its_right_answer(name):
    case = CASES[name]
    found = answered(case)
    assert [one["name"] for one in found["record"]] == list(case.record)
    assert found["effects"] == list(case.effects)
    assert found["adequate"] == case.adequate
    assert case.told in found["advice"]
    assert case.noise in found["noise"]["words"]
    assert found["bad_readings"] == []
