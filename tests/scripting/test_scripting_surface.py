"""What scripts rely on: names, signatures and how light the import is. Change it deliberately."""

import ast
import inspect
import re
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest

import pkmcal

SIGNATURES = {
    "check_machine": "machine, *, closure='', seed=1",
    "choose_poses": "machine=None, n=29, *, site=None, criterion='I', priors=True, "
    "heights=False, calipers=0, calipers_um=20.0, sigma_um=None, angle_mdeg=None, candidates=2500, "
    "seed=1, margin_mm=None, searches=1, workers=None, scheduler='', watch=None, "
    "purpose='accuracy'",
    "compare": "runs, *, add=(), model=None, propose=None, watch=None",
    "complete": "machine, *, tool=False",
    "correct": "model, poses, *, machine=None, payload=None, temperature=None, channels=None, "
    "every=None, before=None, extrapolate=False",
    "design": "runs, discriminate, n=10, *, add=(), model=None, offer=(), candidates=250, seed=1, "
    "watch=None",
    "diagnose": "runs, *, add=(), model=None, offer=(), mask=(), each_run=False, watch=None",
    "discover": "runs, *, add=(), model=None, offer=(), mask=(), each_run=False, watch=None",
    "export": "model, form, *, machine=None",
    "fit_fleet": ("folders, *, add=(), out=None, workers=None, scheduler='', watch=None"),
    "fit": "runs, *, add=(), model=None, mask=()",
    "guess_map": "files, out, *, machine=None",
    "history_of": "folder='sessions', *, serial='', tolerance_um=None",
    "identifiability": "machine, *, closure='', read='nests', nests=3, site=None, sigma_um=None, "
    "frame_free=True, nests_free=False, base_nests=True, poses=None, only=(), seed=1, "
    "monte_carlo=0, workers=None, scheduler='', watch=None",
    "import_run": "files, map, run, *, machine=None, header=None, commands=None, "
    "as_it_stands=False",
    "iso9283": "run, *, point='', pairs=''",
    "kinematics": "machine, file, direction, *, model=None",
    "list_sessions": "folder='sessions'",
    "load_machine": "name_or_path, relative_to=None",
    "load_runs": "runs",
    "mock_station": "machine='hexapod', *, seed=1, scale=600.0, effects=None, folder=None",
    "predict": "model, runs, *, frame=False",
    "sensitivity": "machine, *, closure='', position_um=None, orientation_mdeg=None, poses=500, "
    "seed=1, monte_carlo=0, workers=None, scheduler='', watch=None",
    "session_log": "session=None, *, folder='sessions'",
    "site_kinds": "name=None",
    "simulate": "machine, run, *, seed=1, poses=60, noise_um=None, effects=None, hidden=None, "
    "truth=None, parameters=None, controller=None, cycles=1, order='nest-by-nest', payload=(), "
    "rise=6.0, delays=False, strays=0, title=''",
    "verification_grid": "machine=None, *, site=None",
}
JOBS = {
    "accept": "self",
    "apply": "self, fit, *, yes=False, limits=None",
    "auto": "self, target_um=None, *, hours=None, first=15, apply=True, seed=1, out=None, "
    "decide=None, tell=None",
    "close": "self",
    "connect": "self",
    "measure": "self, poses, *, order=None, reference_every=10, cycles=1, warm_up=True, title='', "
    "pairs=()",
    "propose": "self, fit, *, limits=None",
    "resume": "self, session=None",
    "sets": "self",
    "stop": "self",
    "undo": "self, to=None",
    "verify": "self, poses=None, *, truth=False, reference_every=40, before=None",
}
MADE = "site, *, folder='sessions', operator=None, watch=None"
FIELDS = {
    "AcceptReport": "accepted",
    "ApplyReport": "written changes left_out snapshot kept check_before check_after noise_peak_um",
    "AutoReport": "folder target_um reached why decisions runs model effects in_question "
    "not_asked not_written poses minutes predicted_um verified_um at_most_um",
    "CompareReport": "effects readings rms_um noise_floor_um chi2_per_dof repeatability "
    "reference_repeatability structure together actuators worst_poses bad_readings record advice "
    "noise proposed",
    "CompletionReport": "machine tried parameters rank_before rank_after lacking proposal",
    "CorrectReport": "machine model actuators effects left_out remarks channels poses",
    "DiagnosisReport": "baseline adequate record candidates indistinguishable unexplained likeness "
    "hints noise bad_readings unavailable not_on_this_machine advice",
    "DiscoveryReport": "steps effects adequate record indistinguishable unexplained likeness hints "
    "noise bad_readings unavailable parameters refused impossible not_on_this_machine advice",
    "FitReport": "effects readings chi2_per_dof log10_p p_value rms_um noise_floor_um "
    "holdout_rms_um holdout_floor_um platform_rms_um platform_floor_um by_kind "
    "parameters unidentified unidentified_words bad_readings left_out_readings channels_left_aside "
    "settled steps remarks record noise",
    "FleetReport": "machine effects parameters machines outliers remarks",
    "FollowUpReport": "machine discriminate model runs conditions right_now right_then poses "
    "advice",
    "GridReport": "machine workspace_scale box poses",
    "GuessReport": "map columns rows preview assumed missing",
    "HistoryReport": "machines",
    "IdentifiabilityReport": "machine closure readings poses unknowns rank weak smallest_kept "
    "singular_values base_parameters relations exact_groups identified unidentified sigma_ratio "
    "gauge subsets options drawn",
    "Iso9283Report": "machine point frame left_out poses distances largest",
    "KindsReport": "kinds",
    "MachineCheckReport": "machine limbs parameters actuators task home_gap_mm home_gap_rad "
    "home_pose constraints redundant freedoms_held mobility rank stiffness_home stiffness_least "
    "reach stopped_by used verification_box verification_scale closures traits_stated traits "
    "effects not_on_this_machine",
    "SensitivityReport": "machine closure poses parameters kinds within_tolerances tolerances "
    "drawn",
    "ImportReport": "runs machine map rows readings poses assumed record",
    "KinematicsReport": "machine model direction actuators units places",
    "LogReport": "session entries",
    "PredictReport": "model machine effects frame readings rms_um expected_um noise_um ratio "
    "chi2_per_dof log10_p p_value axes nests worst not_in_model bad_readings left_out_readings "
    "remarks record advice",
    "PosesReport": "machine criterion readings tolerances_as_priors candidates seed purpose "
    "predicted random_poses by_count path_in_strokes pairs with_pairs kept_free will_see "
    "not_asked poses",
    "SessionReport": "session run readings",
    "SessionsReport": "sessions",
    "SetsReport": "sets unknown",
    "SimulationReport": "machine run truth seed poses readings hidden",
    "UndoReport": "restored",
    "VerificationReport": (
        "poses measured noise_alone truth paper expanded axes errors session before"
    ),
}
ERRORS = {"BadInput", "DeviceError", "GateRefused", "NameTaken", "StoppedByOperator"}


def plainly(function: object) -> str:
    """A signature without its types."""
    signature = inspect.signature(function)  # type: ignore[arg-type]
    bare = [p.replace(annotation=p.empty) for p in signature.parameters.values()]
    return str(signature.replace(parameters=bare, return_annotation=signature.empty))[1:-1]


def test_the_names_are_these() -> None:
    assert set(pkmcal.__all__) == {*SIGNATURES, *FIELDS, *ERRORS, "Station", "AsyncStation"}
    assert sorted(pkmcal.__all__) == list(pkmcal.__all__)
    assert dir(pkmcal) == list(pkmcal.__all__)


def test_every_name_has_a_home_that_type_checkers_see() -> None:
    tree = ast.parse(Path(pkmcal.__file__).read_text("utf-8"))
    imported = {
        alias.asname: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    assert imported == pkmcal._HOMES
    assert (Path(pkmcal.__file__).parent / "py.typed").exists()


@pytest.mark.parametrize("name", SIGNATURES)
def test_functions_are_called_like_this(name: str) -> None:
    assert plainly(getattr(pkmcal, name)) == SIGNATURES[name]


@pytest.mark.parametrize("name", JOBS)
def test_a_station_is_called_like_this(name: str) -> None:
    assert plainly(getattr(pkmcal.Station, name)) == JOBS[name]
    assert plainly(getattr(pkmcal.AsyncStation, name)) == JOBS[name]


def test_a_station_is_made_like_this() -> None:
    assert plainly(pkmcal.Station) == plainly(pkmcal.AsyncStation) == MADE


@pytest.mark.parametrize("name", FIELDS)
def test_reports_have_these_fields(name: str) -> None:
    record = getattr(pkmcal, name)
    assert [f.name for f in fields(record) if f.name[0] != "_"] == FIELDS[name].split()
    assert record.FORMAT.startswith("pkm-")


@pytest.mark.parametrize("name", [n for n in SIGNATURES if n != "load_machine"])
def test_every_function_is_documented_with_an_example(name: str) -> None:
    text = inspect.getdoc(getattr(pkmcal, name)) or ""
    for part in ("Parameters\n---", "Raises\n---", "Examples\n---"):
        assert part in text
    for parameter in inspect.signature(getattr(pkmcal, name)).parameters:
        assert f"{parameter} :" in text or f"{parameter}, " in text or f", {parameter}" in text


@pytest.mark.parametrize("name", [n for n in JOBS if n not in ("close", "stop")])
def test_every_job_of_a_station_says_what_it_raises(name: str) -> None:
    text = inspect.getdoc(getattr(pkmcal.Station, name)) or ""
    assert "Raises\n---" in text


def test_unknown_names_are_missing_like_anywhere() -> None:
    with pytest.raises(AttributeError, match="no attribute 'fitt'"):
        pkmcal.fitt  # noqa: B018


def test_the_import_is_light() -> None:
    code = (
        "import sys, pkmcal; heavy = {'numpy', 'click', 'app', 'calib'} & set(sys.modules);"
        "assert not heavy, heavy; pkmcal.BadInput; assert 'numpy' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.long
def test_no_function_needs_the_screens_or_the_command_line() -> None:
    code = (
        "import sys, pkmcal; [getattr(pkmcal, name) for name in pkmcal.__all__];"
        "seen = {'textual', 'click', 'matplotlib'} & set(sys.modules); assert not seen, seen"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


PAGE = (Path(__file__).parents[2] / "docs" / "scripting.md").read_text("utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_the_guide_names_everything_there_is() -> None:
    missing = [name for name in (*pkmcal.__all__, *JOBS) if not re.search(rf"\b{name}\b", PAGE)]
    assert missing == []


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_code_in_the_guide_uses_what_there_is(number: int) -> None:
    tree = ast.parse(BLOCKS[number])
    used = [
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "pkmcal"
    ]
    assert used
    assert set(used) <= set(pkmcal.__all__)


@pytest.mark.long
def test_the_first_code_in_the_guide_runs_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(BLOCKS[0], "scripting.md", "exec"), {})
    assert capsys.readouterr().out.splitlines()[0] == "('backlash',) True"
