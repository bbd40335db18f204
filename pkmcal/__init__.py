"""Calibrate parallel-kinematic machines from scripts and notebooks.

::

    import pkmcal

    pkmcal.simulate("hexapod", "run", seed=3, effects={"backlash.leg3": 0.015})
    found = pkmcal.discover("run")
    print(found.effects, found.adequate)
    found.save("model.toml")

The calls are those of the verbs: a question gets the same answer here and on the command line.
Answers are records with typed fields; ``to_json()`` is what the verb prints with ``--json``.
:class:`Station` measures, verifies and writes back without a person; :func:`mock_station` is one
to practise on. See docs/scripting.md.

Units: mm, s, rad, kg, N, deg C, where a name does not say another one (``_um``, ``_deg``).

What bad input is, is said by :class:`BadInput`; a device that fails, by :class:`DeviceError`; a
safety gate that says no, by :class:`GateRefused`; an operator who stops, by
:class:`StoppedByOperator`. ``import pkmcal`` is light: what a name needs is loaded when it is first
used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pkmcal.names import NameTaken, claim

if TYPE_CHECKING:
    from app.errors import GateRefused as GateRefused
    from app.errors import StoppedByOperator as StoppedByOperator
    from app.files.machines import load_machine as load_machine
    from app.jobs.applying import AcceptReport as AcceptReport
    from app.jobs.applying import ApplyReport as ApplyReport
    from app.jobs.applying import SetsReport as SetsReport
    from app.jobs.applying import UndoReport as UndoReport
    from app.jobs.automatic import AutoReport as AutoReport
    from app.jobs.chosen_runs import load_runs as load_runs
    from app.jobs.comparing import CompareReport as CompareReport
    from app.jobs.comparing import compare as compare
    from app.jobs.completing import CompletionReport as CompletionReport
    from app.jobs.completing import complete as complete
    from app.jobs.correcting import CorrectReport as CorrectReport
    from app.jobs.correcting import correct as correct
    from app.jobs.device_kinds import KindsReport as KindsReport
    from app.jobs.device_kinds import site_kinds as site_kinds
    from app.jobs.discovering import DiagnosisReport as DiagnosisReport
    from app.jobs.discovering import DiscoveryReport as DiscoveryReport
    from app.jobs.discovering import diagnose as diagnose
    from app.jobs.discovering import discover as discover
    from app.jobs.exporting import export as export
    from app.jobs.fitting import FitReport as FitReport
    from app.jobs.fitting import fit as fit
    from app.jobs.fleet import FleetReport as FleetReport
    from app.jobs.fleet import fit_fleet as fit_fleet
    from app.jobs.following_up import FollowUpReport as FollowUpReport
    from app.jobs.following_up import design as design
    from app.jobs.guessing import GuessReport as GuessReport
    from app.jobs.guessing import guess_map as guess_map
    from app.jobs.importing import ImportReport as ImportReport
    from app.jobs.importing import import_run as import_run
    from app.jobs.inspecting import MachineCheckReport as MachineCheckReport
    from app.jobs.inspecting import check_machine as check_machine
    from app.jobs.kinematics import KinematicsReport as KinematicsReport
    from app.jobs.kinematics import kinematics as kinematics
    from app.jobs.listing import LogReport as LogReport
    from app.jobs.listing import SessionsReport as SessionsReport
    from app.jobs.listing import list_sessions as list_sessions
    from app.jobs.listing import session_log as session_log
    from app.jobs.looking_back import HistoryReport as HistoryReport
    from app.jobs.looking_back import history_of as history_of
    from app.jobs.measuring import SessionReport as SessionReport
    from app.jobs.posing import PosesReport as PosesReport
    from app.jobs.posing import choose_poses as choose_poses
    from app.jobs.predicting import PredictReport as PredictReport
    from app.jobs.predicting import predict as predict
    from app.jobs.repeating import Iso9283Report as Iso9283Report
    from app.jobs.repeating import iso9283 as iso9283
    from app.jobs.sensing import SensitivityReport as SensitivityReport
    from app.jobs.sensing import sensitivity as sensitivity
    from app.jobs.simulating import SimulationReport as SimulationReport
    from app.jobs.simulating import simulate as simulate
    from app.jobs.telling_apart import IdentifiabilityReport as IdentifiabilityReport
    from app.jobs.telling_apart import identifiability as identifiability
    from app.jobs.verification_grid import GridReport as GridReport
    from app.jobs.verification_grid import verification_grid as verification_grid
    from app.jobs.verifying import VerificationReport as VerificationReport
    from calib.errors import BadInput as BadInput
    from drivers.errors import DeviceError as DeviceError
    from pkmcal.async_station import AsyncStation as AsyncStation
    from pkmcal.mock import mock_station as mock_station
    from pkmcal.station import Station as Station

_HOMES = {
    "AcceptReport": "app.jobs.applying",
    "ApplyReport": "app.jobs.applying",
    "AsyncStation": "pkmcal.async_station",
    "AutoReport": "app.jobs.automatic",
    "BadInput": "calib.errors",
    "CompareReport": "app.jobs.comparing",
    "CompletionReport": "app.jobs.completing",
    "CorrectReport": "app.jobs.correcting",
    "DeviceError": "drivers.errors",
    "DiagnosisReport": "app.jobs.discovering",
    "DiscoveryReport": "app.jobs.discovering",
    "FitReport": "app.jobs.fitting",
    "FleetReport": "app.jobs.fleet",
    "FollowUpReport": "app.jobs.following_up",
    "GateRefused": "app.errors",
    "GridReport": "app.jobs.verification_grid",
    "GuessReport": "app.jobs.guessing",
    "HistoryReport": "app.jobs.looking_back",
    "IdentifiabilityReport": "app.jobs.telling_apart",
    "ImportReport": "app.jobs.importing",
    "Iso9283Report": "app.jobs.repeating",
    "KindsReport": "app.jobs.device_kinds",
    "KinematicsReport": "app.jobs.kinematics",
    "LogReport": "app.jobs.listing",
    "MachineCheckReport": "app.jobs.inspecting",
    "PosesReport": "app.jobs.posing",
    "PredictReport": "app.jobs.predicting",
    "SensitivityReport": "app.jobs.sensing",
    "SessionReport": "app.jobs.measuring",
    "SessionsReport": "app.jobs.listing",
    "SetsReport": "app.jobs.applying",
    "SimulationReport": "app.jobs.simulating",
    "Station": "pkmcal.station",
    "StoppedByOperator": "app.errors",
    "UndoReport": "app.jobs.applying",
    "VerificationReport": "app.jobs.verifying",
    "check_machine": "app.jobs.inspecting",
    "choose_poses": "app.jobs.posing",
    "compare": "app.jobs.comparing",
    "complete": "app.jobs.completing",
    "correct": "app.jobs.correcting",
    "design": "app.jobs.following_up",
    "diagnose": "app.jobs.discovering",
    "discover": "app.jobs.discovering",
    "export": "app.jobs.exporting",
    "fit": "app.jobs.fitting",
    "fit_fleet": "app.jobs.fleet",
    "guess_map": "app.jobs.guessing",
    "history_of": "app.jobs.looking_back",
    "identifiability": "app.jobs.telling_apart",
    "import_run": "app.jobs.importing",
    "iso9283": "app.jobs.repeating",
    "kinematics": "app.jobs.kinematics",
    "list_sessions": "app.jobs.listing",
    "load_machine": "app.files.machines",
    "load_runs": "app.jobs.chosen_runs",
    "mock_station": "pkmcal.mock",
    "predict": "app.jobs.predicting",
    "sensitivity": "app.jobs.sensing",
    "session_log": "app.jobs.listing",
    "simulate": "app.jobs.simulating",
    "site_kinds": "app.jobs.device_kinds",
    "verification_grid": "app.jobs.verification_grid",
}
"""Where each public name is defined."""

__all__ = [
    "AcceptReport",
    "ApplyReport",
    "AsyncStation",
    "AutoReport",
    "BadInput",
    "CompareReport",
    "CompletionReport",
    "CorrectReport",
    "DeviceError",
    "DiagnosisReport",
    "DiscoveryReport",
    "FitReport",
    "FleetReport",
    "FollowUpReport",
    "GateRefused",
    "GridReport",
    "GuessReport",
    "HistoryReport",
    "IdentifiabilityReport",
    "ImportReport",
    "Iso9283Report",
    "KindsReport",
    "KinematicsReport",
    "LogReport",
    "MachineCheckReport",
    "NameTaken",
    "PosesReport",
    "PredictReport",
    "SensitivityReport",
    "SessionReport",
    "SessionsReport",
    "SetsReport",
    "SimulationReport",
    "Station",
    "StoppedByOperator",
    "UndoReport",
    "VerificationReport",
    "check_machine",
    "choose_poses",
    "compare",
    "complete",
    "correct",
    "design",
    "diagnose",
    "discover",
    "export",
    "fit",
    "fit_fleet",
    "guess_map",
    "history_of",
    "identifiability",
    "import_run",
    "iso9283",
    "kinematics",
    "list_sessions",
    "load_machine",
    "load_runs",
    "mock_station",
    "predict",
    "sensitivity",
    "session_log",
    "simulate",
    "site_kinds",
    "verification_grid",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used; the names of our packages are claimed before."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    claim()
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
