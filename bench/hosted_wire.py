"""The same as ``hosted`` on a real wire: bare drives, or the controller at node 10, and a tracker.

    python -m bench hosted_wire [seed] [bare | node10]

A mock station with the hidden effects of that seed is measured with two payloads and two
temperatures, fitted, written to (host store, or controller), and verified at fresh poses. At the
end stands how far the mock was from its own physics at what was commanded: what the wire adds.
"""

import json
import os
import socket
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import tomli_w

import pkmcal
from app.demo.station import mock_station
from app.files.machines import load_machine
from app.files.pose_table import Pose
from app.files.runs import read_run
from bench._hosted_judge import Judged, judge
from bench._hosted_physics import added_by_the_wire
from bench.hosted import EFFECTS, FROM_LIMITS_MM, hidden_of
from calib.arrays import Array
from calib.command import Identified, Surroundings
from calib.identify import Fit
from calib.mechanism.rigid import Poses
from calib.model import Model
from calib.poses import sample_poses
from calib.runs import Run

MACHINE = load_machine("hexapod")
SCALE = 600.0
CAMPAIGN = ((0.0, 20.5), (5.0, 26.0))
CONDITIONS = ((0.0, 20.5), (0.0, 25.5), (5.0, 20.5), (5.0, 25.5))
MEASURED, FRESH = 32, 40


@dataclass(frozen=True)
class Lab:
    """A mock station: site files by payload, and hands that heat it and put masses on."""

    folder: Path
    said: dict[str, Any]

    def do(self, **what: object) -> dict[str, Any]:
        """Ask the back door of the station."""
        host, port = self.said["hands"]["control"].rsplit(":", 1)
        with socket.create_connection((host, int(port)), timeout=30.0) as link:
            link.sendall(json.dumps(what).encode() + b"\n")
            answer: dict[str, Any] = json.loads(link.makefile().readline())
        assert answer["ok"], answer
        return answer

    def site(self, payload_kg: float, temperature_C: float) -> Path:
        """Put a mass on, bring the structure to a temperature; the site file that says the mass."""
        self.do(do="payload", kg=payload_kg)
        self.do(do="temperature", structure_C=temperature_C)
        load = {**self.said["load"], "payload_kg": payload_kg}
        path = self.folder / f"site-{payload_kg:g}.toml"
        path.write_text(tomli_w.dumps({**self.said, "load": load}), encoding="utf-8")
        return path

    def station(self, payload_kg: float, temperature_C: float) -> pkmcal.Station:
        """Connect under these conditions."""
        site = self.site(payload_kg, temperature_C)
        return pkmcal.Station(site, folder=self.folder / "sessions")


def poses_of(count: int, seed: int) -> dict[str, Pose]:
    """Reachable poses away from the strokes, labelled 1, 2, ..."""
    drawn = sample_poses(MACHINE, 4 * count, np.random.default_rng(seed))
    low, high = MACHINE.q_limits.T[:, :, None]
    inside = np.all((drawn.q > low + FROM_LIMITS_MM) & (drawn.q < high - FROM_LIMITS_MM), axis=0)
    chosen = drawn.take(np.flatnonzero(inside)[:count]).poses.to_xyz_rpy().T
    return {str(k + 1): _pose(row) for k, row in enumerate(chosen)}


def _pose(row: Array) -> Pose:
    x, y, z, rx, ry, rz = map(float, row)
    return x, y, z, rx, ry, rz


def job(lab: Lab, seed: int, say: Callable[[str], None]) -> list[Judged]:
    """Measure, identify, write, verify."""
    runs = []
    for number, (payload, temperature) in enumerate(CAMPAIGN):
        with lab.station(payload, temperature) as station:
            poses = poses_of(MEASURED, 100 * seed + number)
            runs.append(station.measure(poses, warm_up=False).run)
        say(f"measured with {payload:g} kg at {temperature} deg C")
    found = pkmcal.fit(runs, add=EFFECTS)
    model = lab.folder / "model.toml"
    found.save(model)
    say(f"fit: chi-square per dof {found.chi2_per_dof:.2f}, RMS {found.rms_um:.2f} um")
    with lab.station(*CONDITIONS[0]) as station:
        done = station.apply(model, yes=True)
    say(f"written {len(done.changes)} values; not written: {', '.join(done.left_out) or 'none'}")
    answers = []
    for number, (payload, temperature) in enumerate(CONDITIONS):
        wanted = poses_of(FRESH, 100 * seed + 50 + number)
        with lab.station(payload, temperature) as station:
            seen = station.verify(wanted, truth=True)
        run = read_run(Path(seen.session) / "run").run
        assert seen.truth is not None
        answers.append(_judged(found._fit, run, wanted, seed))
        one = answers[-1]
        say(
            f"{payload:g} kg {temperature} deg C: RMS {one.rms:.2f} um, expected "
            f"{one.expected_rms:.2f}, ratio {one.ratio:.3f}, peak {one.peak:.2f}, "
            f"99 % {one.peak_99:.2f}; in truth {seen.truth.position_rms_um:.2f}, by the fit's "
            f"covariance {one.fit_rms:.2f}"
        )
    added = added_by_the_wire(lab.folder / "sessions", lab.do(do="truth"))
    say(f"what the wire adds at {added.size} poses: {np.sqrt(np.mean(added**2)):.3f} um RMS, "
        f"{added.max():.3f} at most")  # fmt: skip
    return answers


def _judged(fit: Fit, run: Run, wanted: dict[str, Pose], seed: int) -> Judged:
    model: Model = fit.model
    values = dict(zip(model.names, map(float, fit.values), strict=True))
    whole = Identified.from_values(MACHINE, values, model.effects, run.header.load)
    rows = [run.pose.index(label) for label in wanted]
    told = ("payload_kg", "structure_temp_C")
    here = Surroundings({name: run.channels[name][rows] for name in told})
    task = Poses.from_xyz_rpy(np.array(list(wanted.values())).T)
    generator = np.random.default_rng(seed)
    return judge(run, task, whole, fit, run.q[:, rows], here, generator)


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    way = sys.argv[2] if len(sys.argv) > 2 else "bare"
    began = time.monotonic()

    def say(what: str) -> None:
        print(f"{way} seed {seed} {time.monotonic() - began:6.1f} s  {what}", flush=True)

    with tempfile.TemporaryDirectory(prefix="pkmcal-hosted-") as made:
        folder = Path(made)
        os.environ["PKMCAL_STATE"] = str(folder / "state")
        hidden = folder / "hidden.toml"
        hidden.write_text(tomli_w.dumps({"hidden": hidden_of(seed)}), encoding="utf-8")
        arguments = ["--hidden", str(hidden), *(["--bare"] if way == "bare" else [])]
        with mock_station("hexapod", seed, SCALE, folder, arguments) as site:
            lab = Lab(folder, tomllib.loads(site.read_text("utf-8")))
            job(lab, seed, say)


if __name__ == "__main__":
    main()
