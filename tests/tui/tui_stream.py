"""A recorded stream of a session's events, and what else the screens need to be looked at."""

import json
import math
import tomllib
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from app.files.site import Site, load_site
from app.history.store import Entry, History
from app.session import events as ev
from app.session import kinds
from app.session.folder import make_folder
from app.session.journal import IDENTITIES, Journal
from app.session.known import Snapshot
from app.session.plan import Plan, Step
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from app.tui.analysis import FitAnswer
from app.tui.correction import Comparison
from app.tui.discovering import Search, Stair, View
from app.tui.program import Workbench
from app.tui.reading_lines import ReadingLine
from app.tui.verifying import Verified
from app.verification import Verification
from app.writeback.proposal import Change, Proposal
from calib.frames import nest_in_base
from drivers.interface import (
    ActuatorState,
    Alarm,
    ControllerState,
    Identity,
    TrackerState,
)

SITE = """
format = "pkm-site/1"
title = "Cell 4, hexapod"
machine = "hexapod"
[controller]
kind = "canopen"
channel = "socket://127.0.0.1:40001"
[tracker]
kind = "emscon"
address = "127.0.0.1:700"
frame = [-900.0, -900.0, -400.0, 0.0, 0.0, 0.3]
[nests.platform]
"3" = [0.0, 100.0, 0.0]
"4" = [-86.6, -50.0, 0.0]
"5" = [86.6, -50.0, 0.0]
[nests.base]
b1 = [260.0, 0.0, -30.0]
b2 = [0.0, 260.0, -30.0]
b3 = [-260.0, 0.0, -30.0]
"""

NESTS = {
    name: tuple(place)
    for kind in tomllib.loads(SITE)["nests"].values()
    for name, place in kind.items()
}

CONTROLLER = Identity("canopen", "", "pkmcal hexapod controller", "1001", "1.0.0")
TRACKER = Identity("emscon", "", "AT901-LR", "390793", "3.6")
QUESTION = ev.PromptNeeded(
    "prompt-1",
    "Put the SMR into nest 4, keeping the beam on it if you can, then step back.",
    ("done", "stop"),
    None,
)
DECISION = ev.PromptNeeded(
    "decide",
    "tell tracker-drift from frame-shift: the readings cannot tell tracker-drift from frame-shift "
    "(the right answer with a probability of 0.93 now, 1.00 then)",
    ("go on", "skip", "measure 7 poses instead", "tell backlash from nothing instead",
     "write the correction instead", "stop"),
    None,
)  # fmt: skip


def plan_of(site: Site, poses: int = 12) -> Plan:
    """A measuring plan over poses on a circle."""
    angles = np.linspace(0.0, 2.0 * math.pi, poses, endpoint=False)
    path = {
        f"p{number:02d}": (30 * math.cos(a), 30 * math.sin(a), 220.0, 0.1, -0.1, 0.05)
        for number, a in enumerate(angles, start=1)
    }
    return measure_plan(site, path, PlanOptions())


def connected() -> list[ev.Event]:
    """Both devices answer; a drive complains."""
    actuators = tuple(
        ActuatorState(f"q{leg}", 230.715 + leg, 230.715 + leg, "operation enabled", leg == 2, True)
        for leg in range(1, 7)
    )
    channels = {"structure_temp_C": 20.53, "payload_kg": 0.0}
    return [
        ev.Connected("controller", CONTROLLER, "socket://127.0.0.1:40001"),
        ev.Connected("tracker", TRACKER, "127.0.0.1:700"),
        ev.DeviceStates(
            ControllerState(actuators, True, True, channels),
            TrackerState(True, True, True, True, "CCR-1.5in", 1),
        ),
        ev.AlarmRaised(
            Alarm("tracker", "air pressure is 40 min old", "Check the weather station"), 61.0
        ),
    ]


def measured(plan: Plan, until: int) -> list[ev.Event]:
    """The first steps of a plan, as the engine tells of them; the step ``until`` is in work."""
    told: list[ev.Event] = []
    number = 0
    for index, step in enumerate(plan.steps[: until + 1]):
        time_s = 10.0 * index
        told.append(ev.StepStarted(step.id, index, step.kind.name, step.says, 1, time_s))
        if index == until:
            break
        if step.kind is kinds.MOVE:
            pose = plan.poses[step.args["pose"]]
            q = tuple(230.0 + 3.0 * math.sin(index + leg) for leg in range(6))
            told.append(ev.PoseCommanded(step.args["pose"], pose, q, time_s))
        if step.kind in (kinds.READ, kinds.REFERENCE):
            number += 1
            off = 0.6 + 0.2 * math.sin(index) if step.kind is kinds.READ else 0.008
            seen, there, miss = reading_of(plan, step, off)
            told += [ev.LiveScatter(0.03 / (1 + k), 0.02, (0.0, 0.0, 0.0), k > 1) for k in range(5)]
            told.append(
                ev.ReadingTaken(
                    number, str(step.args.get("pose", "")), step.args["nest"], (230.0,) * 6,
                    seen, there, miss, 0.006, time_s,
                )
            )  # fmt: skip
        if step.kind is kinds.DRIFT:
            told.append(ev.FrameFound((0.0,) * 6, 0.0041, ("b1", "b2", "b3")))
            told.append(ev.DriftChecked(0.0067, 0.05, time_s))
        told.append(ev.StepDone(step.id, index, f"{step.says}: done", time_s + 5.0))
        told.append(ev.Progress(index + 1, len(plan.steps), 600.0 - index))
    return told


def reading_of(plan: Plan, step: Step, off: float) -> tuple[ev.Vector, ev.Vector, float]:
    """Where a nest is seen, where it is predicted, and how far apart these are: along x."""
    nest = step.args["nest"]
    pose = plan.poses.get(step.args.get("pose", ""), (0.0,) * 6)
    x, y, z = map(float, nest_in_base(pose, NESTS[nest]))
    return (x + off, y, z), (x, y, z), off


async def put_up(bench: Workbench, folder: Path, until: int = 30) -> Session:
    """Open a site and show a session that measures, without devices."""
    path = folder / "site.toml"
    path.write_text(SITE, encoding="utf-8")
    desk = bench.desk
    await desk.open_site(path)
    assert desk.site is not None
    plan = plan_of(desk.site)
    session = Session.create(desk.site, plan, folder / "sessions", station=desk.station)
    for event in connected():
        desk.picture.tell(event)
    desk.picture.begin(session)
    for event in measured(plan, until):
        desk.picture.tell(event)
    return session


def verified(size_um: float, seed: int) -> Verified:
    """A verification with errors of a size."""
    generator = np.random.default_rng(seed)
    labels = tuple(f"n{node:02d}o{turn}" for node in range(1, 28) for turn in range(1, 9))
    position = generator.normal(0.0, size_um * 1e-3 / 2.0, (3, len(labels)))
    rotation = generator.normal(0.0, size_um * 2e-6, (3, len(labels)))
    found = Verification(labels, position, rotation, 8.5, 0.0055, position * 0.9, rotation * 0.9)
    errors = np.array(
        [
            1e3 * np.linalg.norm(position, axis=0),
            1e3 * np.rad2deg(np.linalg.norm(rotation, axis=0)),
        ]
    )
    return Verified(Path("sessions"), found, errors)


def compared() -> Comparison:
    """A proposal with its gates."""
    changes = tuple(
        Change(f"leg{leg}.{name}", 100.0 + leg, 100.1 + leg, 0.01 * (7 - leg), "mm", name != "L_B")
        for leg in range(1, 7)
        for name in ("B_x", "B_y", "B_z", "L_B")
    ) + tuple(
        Change(f"screw-cyclic-table.leg{leg}.7", 0.0, 0.0001 * leg, 0.0005, "mm", True)
        for leg in range(1, 7)
    )
    left_out = {"tracker-scale": "an effect of the measurement, never written to a machine"}
    gates = (
        ev.GateChecked(
            "finite",
            True,
            0.0,
            0.0,
            "",
            "finite: values that are not finite numbers: 0 (at most 0)",
        ),
        ev.GateChecked(
            "chi2",
            True,
            1.04,
            4.0,
            "",
            "chi2: chi-square per degree of freedom of the fit: 1.04 (at most 4)",
        ),
        ev.GateChecked(
            "holdout",
            False,
            1.73,
            1.5,
            "",
            "holdout: RMS of poses that the fit had not seen, over that of a perfect model: "
            "1.73 (at most 1.5)",
        ),
    )
    return Comparison(Path("model.toml"), Proposal(changes, left_out), gates)


def snapshots() -> tuple[Snapshot, ...]:
    """Two earlier parameter sets."""
    return tuple(
        Snapshot(n, f"2026-11-0{n}T08:00:00+00:00", why, "hexapod", CONTROLLER, 7, {"leg1.L0": 1.0})
        for n, why in ((1, "before applying model.toml"), (2, "applied model.toml"))
    )


def searched() -> Search:
    """A discovery after one step: what is left, where it fails, candidates."""
    candidates = [
        {
            "effect": name,
            "p_value": p,
            "rms_after_um": 8.2 + 0.1 * number,
            "holdout_rms_after_um": 9.2 + 0.1 * number,
            "visible": 0.9 - 0.05 * number,
            "parameters": [
                {"name": f"{name}.c", "value": 1.35e-4, "sigma": 1.2e-5, "unit": "mm/N"}
            ],
        }
        for number, (name, p) in enumerate(
            [("gravity-sag", 9e-17), ("screw-pitch", 0.1), ("joint-tilt", 0.8), ("settling", 1.0)]
        )
    ]
    structure = [
        {
            "channel": channel,
            "significant": number < 2,
            "explains_um": 3.0 - number,
            "p_value": 10.0 ** (3 * number - 6),
            "period": 4.08 if number == 0 else None,
            "shows_in": "extension of q4",
            "unit": "um",
            "bins": [
                {"from": k, "to": k + 1.0, "readings": 30, "value": 5 * math.sin(k), "sigma": 1.0}
                for k in range(6)
            ],
        }
        for number, channel in enumerate(("q4", "payload_kg", "time_s"))
    ]
    diagnosis = {
        "adequate": False,
        "candidates": candidates,
        "indistinguishable": [["gravity-sag", "tracker-drift"]],
        "bad_readings": [],
        "advice": "Add gravity-sag (the legs give way under the weight of platform and payload): "
        "the error on held-out poses falls from 10.0 to 9.2 um.",
    }
    comparison = {"structure": structure, "repeatability": {"times_stated_sigma": 0.97}}
    found = [
        {"name": f"screw-cyclic.leg{leg}.sin", "value": 0.0019, "sigma": 0.0005, "unit": "mm"}
        for leg in range(1, 7)
    ]
    stairs = [
        Stair("start", 11.0, 8.38, 12.39, 9.04, 1.72),
        Stair("+ screw-cyclic", 8.74, 8.31, 9.98, 9.18, 1.11),
    ]
    view = View(("screw-cyclic",), None, diagnosis, comparison, found)
    return Search((), None, stairs, view)


def flown(folder: Path) -> Path:
    """The journal of an autopilot that has told a pair apart and asks whether to write."""
    run = "sessions/20261122-0800-hexapod-measure"
    plain: dict[str, Any] = {"pair": None, "expected": {}, "reached": None, "count": 0}
    lines: list[dict[str, Any]] = [
        {"event": "begun", "seed": 1,
         "limits": {"target_um": 8.0, "minutes": 360.0, "first": 15, "apply": True}},
        {"event": "decided", "number": 1, **plain, "kind": "measure", "count": 15,
         "why": "nothing was measured yet"},
        {"event": "done", "number": 1, "run": f"{run}/run", "poses": 15, "minutes": 30.2},
        {"event": "found", "runs": [f"{run}/run"], "model": "model-01.toml",
         "effects": ["backlash", "tracker-drift"], "unexplained": False, "conditions": {},
         "ambiguous": [["tracker-drift", "frame-shift"]], "predicted_um": 9.1},
        {"event": "decided", "number": 2, **plain, "kind": "tell-apart", "count": 10,
         "pair": ["tracker-drift", "frame-shift"],
         "why": "the readings cannot tell tracker-drift from frame-shift",
         "expected": {"right_now": 0.93, "right_then": 1.0}},
        {"event": "done", "number": 2, "run": f"{run}-2/run", "poses": 10, "minutes": 17.2},
        {"event": "found", "runs": [f"{run}/run", f"{run}-2/run"], "model": "model-02.toml",
         "effects": ["backlash"], "unexplained": False, "conditions": {}, "ambiguous": [],
         "predicted_um": 3.0},
        {"event": "decided", "number": 3, **plain, "kind": "apply", "ground": "write",
         "why": "3.0 um are predicted, 8 um are wanted", "expected": {"predicted_um": 3.0}},
    ]  # fmt: skip
    folder.mkdir()
    text = "".join(json.dumps(line) + "\n" for line in lines)
    (folder / "decisions.jsonl").write_text(text, encoding="utf-8")
    return folder


def fitted() -> FitAnswer:
    """A fit of six legs with one parameter in four left open."""
    parameters = [
        {
            "name": f"leg{leg}.{name}",
            "value": 100.1 + leg,
            "sigma": 0.01 * leg,
            "unit": "mm",
            "nominal": 100.0 + leg,
            "identified": name != "L_B",
        }
        for leg in range(1, 7)
        for name in ("B_x", "B_y", "B_z", "L_B")
    ]
    alone = [f"leg{leg}.L_B" for leg in range(1, 7)]
    report = {
        "effects": [],
        "readings": 95,
        "rms_um": 8.39,
        "noise_floor_um": 8.3,
        "holdout_rms_um": 9.65,
        "holdout_floor_um": 9.18,
        "chi2_per_dof": 1.02,
        "p_value": 0.43,
        "remarks": [],
        "parameters": parameters,
        "unidentified": [[name] for name in alone],
        "unidentified_words": [f"{name} is not seen" for name in alone],
        "bad_readings": [{"line": 118, "why": "reads as nest 4, was labelled 5"}],
        "left_out_readings": 0,
        "noise": {"components": [], "uncertainty_ratio": 1.0, "words": ""},
    }
    generator = np.random.default_rng(3)
    before, after = np.abs(generator.normal(0.0, [[0.25], [0.006]], (2, 95)))
    return FitAnswer(
        ("sessions/20261122-0800-hexapod-measure/run",), (), None, report, before, after, readings()
    )


def remember(folder: Path) -> None:
    """Five calibrations, a month apart: leg 3 grows, leg 1 was hit before the last one."""
    generator = np.random.default_rng(12)
    begun = datetime(2026, 1, 5, 8, tzinfo=UTC)
    for month in range(5):
        values = {f"leg{leg}.{name}": 100.0 + leg for leg in range(1, 7) for name in ("B_x", "L0")}
        values["leg3.L0"] += 0.003 * month
        values["leg1.L0"] += 0.06 * (month == 4)
        found = [
            {"name": n, "value": v + generator.normal(0.0, 0.0005), "sigma": 5e-4, "unit": "mm"}
            for n, v in values.items()
        ]
        said = {"runs": [f"run{month}"], "effects": [], "rms_um": 6.0, "parameters": found}
        utc = (begun + timedelta(days=30 * month)).isoformat()
        History(folder).add(Entry("fit", utc, "hexapod", "1001", f"run{month}", said))


def begun_elsewhere(folder: Path) -> Path:
    """A session that another terminal has brought to its sixth step."""
    (folder / "site.toml").write_text(SITE, encoding="utf-8")
    site = load_site(folder / "site.toml")
    plan = plan_of(site, 3)
    there = make_folder(folder / "elsewhere", site, plan)
    journal = Journal(there / "journal.sqlite")
    journal.set_meta(IDENTITIES, {"controller": {"serial": "1001"}})
    for number, step in enumerate(plan.steps[:6]):
        utc = f"2026-11-29T06:00:{number:02d}.000+00:00"
        journal.started(step.id, 1, float(number), utc)
        if number < 5:
            journal.done(step.id, 1, float(number), utc, {})
    journal.note("answer", "done", 6.0, "2026-11-29T06:00:06.000+00:00")
    journal.close()
    return there


def readings() -> tuple[ReadingLine, ...]:
    """What a fit leaves of 90 readings and two of the base; the errors turn round an upright axis.

    One was masked by hand.
    """
    generator = np.random.default_rng(7)
    lines = []
    for number in range(1, 93):
        base = number > 90
        x, y, z = generator.uniform((-60, -60, 190), (60, 60, 250))
        dx, dy, dz = generator.normal((-0.1 * y, 0.1 * x, 0.0), 2.0)
        size = math.hypot(dx, dy, dz)
        nest = "b1" if base else str(3 + number % 3)
        left_out = "masked by the operator" if number == 17 else ""
        lines.append(
            ReadingLine(
                number, str(number + 1), number + 1, "" if base else f"p{(number + 2) // 3:02d}",
                nest, not base, (dx, dy, dz), size, size / 3.0, (x, y, z), left_out,
            )
        )  # fmt: skip
    return tuple(lines)
