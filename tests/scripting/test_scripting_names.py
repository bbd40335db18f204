"""Files of a lab that have the names of our packages: passed by where they can be, else named."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from app.again import command_of
from pkmcal.names import PARTS, ROOT

PROGRAM = [str(Path(sys.executable).with_name("pkmcal"))]
EVERY_NAME = (*PARTS, "pkmcal")


def lab_of(folder: Path, names: tuple[str, ...]) -> Path:
    """A lab's folder with modules that end whoever imports them."""
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / f"{name}.py").write_text(f"raise RuntimeError('the lab has {name}')\n", "utf-8")
    return folder


def run_in(
    folder: Path, command: list[str], path: str | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run a command in a folder; its standard input is at its end."""
    around = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    if path is not None:
        around["PYTHONPATH"] = path
    return subprocess.run(
        command, cwd=folder, env=around, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip


def simulated(folder: Path) -> Path:
    done = run_in(
        folder, [*PROGRAM, "simulate", "hexapod", "--poses", "8", "--out", "run", "--json"]
    )
    assert done.returncode == 0, done.stderr
    return folder / "run"


@pytest.mark.long
def test_files_in_the_current_folder_are_passed_by(tmp_path: Path) -> None:
    lab = lab_of(tmp_path / "lab", EVERY_NAME)
    run = simulated(lab)
    fitted = run_in(lab, [*PROGRAM, "fit", str(run), "--json"])
    assert fitted.returncode == 0, fitted.stderr
    assert json.loads(fitted.stdout)["format"] == "pkm-fit/1"


@pytest.mark.long
def test_a_mock_starts_and_ends_in_such_a_folder(tmp_path: Path) -> None:
    lab = lab_of(tmp_path / "lab", EVERY_NAME)
    mock = ["mock", "hexapod", "--json", "--until-stdin-closes"]
    for command in ([*PROGRAM, *mock], command_of(*mock)):
        done = run_in(lab, command)
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["format"] == "pkm-mock/1"


@pytest.mark.long
@pytest.mark.parametrize("module", ["app", "pkmcal"])
def test_python_m_passes_them_by_too(module: str, tmp_path: Path) -> None:
    lab = lab_of(tmp_path / "lab", tuple(name for name in PARTS if name != module))
    done = run_in(lab, [sys.executable, "-m", module, "machine", "check", "hexapod"])
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", PARTS)
def test_a_foreign_module_on_the_path_is_named(name: str, tmp_path: Path) -> None:
    lab = lab_of(tmp_path / "lab", (name,))
    for command in (PROGRAM, command_of()):
        done = run_in(tmp_path, [*command, "machine", "check", "hexapod"], path=str(lab))
        assert done.returncode == 2
        assert str(lab / f"{name}.py") in done.stderr
        assert "Traceback" not in done.stderr
        assert done.stdout == ""


def test_the_current_folder_on_the_path_by_an_empty_entry_is_named(tmp_path: Path) -> None:
    lab = lab_of(tmp_path / "lab", ("calib",))
    done = run_in(lab, [*PROGRAM, "machine", "check", "hexapod"], path=f"{os.pathsep}/nowhere")
    assert done.returncode == 2
    assert "calib.py" in done.stderr


@pytest.mark.long
def test_a_folder_of_data_with_such_a_name_harms_nobody(tmp_path: Path) -> None:
    for name in PARTS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "notes.txt").write_text("nothing to import\n", "utf-8")
    done = run_in(tmp_path, [*PROGRAM, "machine", "check", "hexapod"], path=str(tmp_path))
    assert done.returncode == 0, done.stderr


def installed(folder: Path, names: tuple[str, ...] = EVERY_NAME) -> Path:
    """Our packages as an installation lays them down: copied side by side."""
    for name in names:
        without = shutil.ignore_patterns("__pycache__", "papers", "templates")
        shutil.copytree(ROOT / name, folder / name, ignore=without)
    return folder


def test_an_installation_without_links_starts_its_children(tmp_path: Path) -> None:
    site, lab = installed(tmp_path / "site"), lab_of(tmp_path / "lab", EVERY_NAME)
    way_in = [sys.executable, "-P", str(site / "pkmcal" / "__main__.py")]
    done = run_in(lab, [*way_in, "mock", "hexapod", "--json", "--until-stdin-closes"], str(site))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["machine"] == "hexapod"


def test_parts_of_two_installations_are_not_mixed(tmp_path: Path) -> None:
    other = installed(tmp_path / "other", ("calib",))
    done = run_in(tmp_path, [*PROGRAM, "machine", "check", "hexapod"], path=str(other))
    assert done.returncode == 2
    assert str(other / "calib") in done.stderr


@pytest.mark.parametrize("text", ["VERSION = 1\n", "raise RuntimeError\n"])
def test_a_package_written_over_ours_is_named(text: str, tmp_path: Path) -> None:
    site = installed(tmp_path / "site")
    (site / "drivers" / "__init__.py").write_text(text, "utf-8")
    done = run_in(
        tmp_path, [sys.executable, "-m", "pkmcal", "machine", "check", "hexapod"], str(site)
    )
    assert done.returncode == 2
    assert str(site / "drivers") in done.stderr
    assert "environment of its own" in done.stderr


def test_a_script_beside_such_a_file_is_told(tmp_path: Path) -> None:
    lab = lab_of(tmp_path / "lab", ("calib",))
    script = lab / "measure_tonight.py"
    script.write_text(
        "import pkmcal\n"
        "try:\n"
        "    pkmcal.fit('run')\n"
        "except pkmcal.NameTaken as taken:\n"
        "    print(taken)\n",
        "utf-8",
    )
    done = run_in(tmp_path, [sys.executable, str(script)])
    assert done.returncode == 0, done.stderr
    assert str(lab / "calib.py") in done.stdout


def test_a_script_that_has_its_own_module_in_memory_is_told(tmp_path: Path) -> None:
    (tmp_path / "drivers.py").write_text("SPEED = 3\n", "utf-8")
    script = tmp_path / "measure_tonight.py"
    script.write_text("import drivers\nfrom pkmcal import Station\n", "utf-8")
    done = run_in(tmp_path, [sys.executable, str(script)])
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith("pkmcal.names.NameTaken: ")
    assert str(tmp_path / "drivers.py") in done.stderr
