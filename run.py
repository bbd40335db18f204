"""Make what pkmcal needs in .venv beside this file, then run one of its jobs.

    python3 run.py demo          the main job on the mock hexapod, end to end
    python3 run.py test          the tests (further arguments go to pytest; -m long: the long ones)
    python3 run.py check         formatting, lint, types and layering
    python3 run.py bench [NAME]  the benchmarks, as ratios
    python3 run.py docs          the documentation as a site, in site/index.html
    python3 run.py docs --check  the commands that the documentation shows, and their output
    python3 run.py pkmcal ...    any verb of the program

Needs Python >= 3.11 with venv, and nothing else; works on Linux, macOS and Windows.
"""

import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
SCRIPTS = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")

CHECKS = (
    ("ruff", "format", "--check", "."),
    ("ruff", "check", "."),
    ("mypy",),
    ("lint-imports",),
)


def ensure_environment(*extras: str) -> None:
    """Create the environment and install the pinned packages, unless that is done already.

    Extras that are asked for together are installed, and the compiled parts built, at once.
    """
    built_from = [ROOT / "pyproject.toml", ROOT / "constraints.txt"]
    built_from += sorted((ROOT / "calib").glob("*/core/*"))
    wanted = hashlib.sha256(
        b"".join(path.read_bytes() for path in built_from) + sys.version.encode()
    ).hexdigest()
    stamps = [ENVIRONMENT / f"installed-{extra or 'base'}" for extra in extras]
    if PYTHON.exists() and all(one.exists() and one.read_text() == wanted for one in stamps):
        return
    print("Installing pkmcal and its pinned dependencies into .venv ...", flush=True)
    if not PYTHON.exists():
        venv.create(ENVIRONMENT, with_pip=True)
    named = ",".join(filter(None, extras))
    target = f"{ROOT}[{named}]" if named else str(ROOT)
    constraints = str(ROOT / "constraints.txt")
    subprocess.run(
        [
            PYTHON,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--constraint",
            constraints,
            "--editable",
            target,
        ],
        check=True,
    )
    for stamp in stamps:
        stamp.write_text(wanted)


def run(*command: str) -> int:
    """Run one command of the environment and return its exit code."""
    return subprocess.run([str(SCRIPTS / command[0]), *command[1:]], cwd=ROOT).returncode


def main(arguments: list[str]) -> int:
    """Run the job named by the first argument."""
    job, rest = (arguments[0], arguments[1:]) if arguments else ("help", [])
    if job in ("demo", "pkmcal"):
        ensure_environment("")
        return run("pkmcal", *(["demo"] if job == "demo" else []), *rest)
    if job == "test":
        ensure_environment("dev")
        # Half of the time they wait for machines; what stands together shares its fixtures.
        return run("pytest", "--dist", "worksteal", *(rest or ["-n", "4"]))
    if job == "check":
        ensure_environment("dev")
        return max(run(*check) for check in CHECKS)
    if job == "docs" and rest[:1] == ["--check"]:
        ensure_environment("dev")
        return run("python", str(ROOT / "docs" / "check_commands.py"), *rest[1:])
    if job == "docs":
        ensure_environment("docs")
        return run("python", str(ROOT / "docs" / "build_site.py"))
    if job == "bench":
        ensure_environment("bench")
        return run("python", "-m", "bench", *rest)
    print(__doc__)
    return 0 if job in ("help", "-h", "--help") else 2


if __name__ == "__main__":
    if sys.version_info < (3, 11):  # noqa: UP036 - said in words to someone with an older Python
        sys.exit(f"pkmcal needs Python 3.11 or newer; this is {sys.version.split()[0]}")
    sys.exit(main(sys.argv[1:]))
