"""Ask a verb about a spoilt file, within limits of time and memory, and judge the answer."""

import contextlib
import io
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from app.cli import run
from bench._fuzz_kinds import Kind

LONGEST_S = 20.0
MOST_MB = 1024


@dataclass(frozen=True)
class Asked:
    """Exit code, what was said, CPU seconds; ``fault`` is empty where the answer is in order."""

    code: int
    said: str
    seconds: float
    fault: str = ""


class TooLong(BaseException):
    """A verb that does not come to an end."""


class Asker:
    """Verbs asked in one folder, in which one file at a time is spoilt.

    ``limits``: this process is the asker's own, its folder and memory are set.
    """

    def __init__(self, folder: Path, *, limits: bool = True) -> None:
        self.folder = folder
        if not limits:
            return
        os.environ["PKMCAL_STATE"] = str(folder / "state")
        os.chdir(folder)
        soft = int(_memory_mb()) + MOST_MB
        resource.setrlimit(resource.RLIMIT_DATA, (soft * 2**20, resource.RLIM_INFINITY))

    def text(self, name: str) -> str:
        """The whole file."""
        return (self.folder / name).read_text(encoding="utf-8")

    def memory_mb(self) -> float:
        """The most memory that this process has had."""
        return _memory_mb()

    def ask(self, kind: Kind, data: bytes, *, process: bool = False) -> Asked:
        """Ask about a file with these bytes; afterwards it is whole again."""
        path = self.folder / kind.file
        whole = path.read_bytes()
        path.write_bytes(data)
        try:
            return self._process(kind) if process else self._here(kind)
        finally:
            path.write_bytes(whole)
            shutil.rmtree(self.folder / "new", ignore_errors=True)
            (self.folder / "new.toml").unlink(missing_ok=True)

    def _here(self, kind: Kind) -> Asked:
        said = io.StringIO()
        begun = time.process_time()
        fault, code = "", 1
        with _limited(), _captured(said) as low:
            try:
                code = run(list(kind.command))
            except TooLong:
                fault = f"no answer within {LONGEST_S:g} s"
            except MemoryError:
                fault = "out of memory"
            except BaseException as error:
                fault = _named(error)
                said.write(traceback.format_exc())
        seconds = time.process_time() - begun
        text = said.getvalue() + "".join(low)
        return Asked(code, text, seconds, fault or _wrong_words(code, text))

    def _process(self, kind: Kind) -> Asked:
        command = [sys.executable, "-m", "pkmcal", *kind.command]
        begun = time.monotonic()
        root = str(Path(__file__).parents[1])
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=10 * LONGEST_S, check=False,
            errors="replace", env={**os.environ, "PYTHONPATH": root},
        )  # fmt: skip
        text = done.stdout + done.stderr
        return Asked(
            done.returncode, text, time.monotonic() - begun, _wrong_words(done.returncode, text)
        )


def _wrong_words(code: int, text: str) -> str:
    """What is wrong with an answer by its code and its words."""
    if "Traceback" in text or code not in (0, 2):
        return f"exit code {code}: {text[-200:]}"
    if "Warning" in text or "** On entry" in text:
        return f"a library's warning: {text[-160:]}"
    if code == 2:
        words = text.rpartition("bad input: ")[2].strip()
        if ": " not in words or ". " not in words:
            return f"refused without place or remedy: {words[:160]}"
    return ""


def _named(error: BaseException) -> str:
    """An exception by its kind and the last place in our own code."""
    ours = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if "site-packages" not in frame.filename and "/lib/python" not in frame.filename
    ]
    frame = ours[-1]
    return f"{type(error).__name__} at {'/'.join(Path(frame.filename).parts[-3:])}:{frame.lineno}"


def _memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """An end to CPU time."""

    def ring(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


@contextlib.contextmanager
def _captured(said: io.StringIO) -> Iterator[list[str]]:
    """Everything that is printed, by Python and by libraries below it."""
    low: list[str] = []
    read, write = os.pipe()
    os.set_blocking(read, False)
    kept = os.dup(2)
    os.dup2(write, 2)
    try:
        with (
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("always")
            yield low
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(write)
        with contextlib.suppress(BlockingIOError):
            low.append(os.read(read, 1 << 16).decode("utf-8", "replace"))
        os.close(read)
