"""LinuxCNC as a process: one at a time on a computer, started and ended without a screen."""

import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

PYTHON = "/usr/bin/python3"
NOBODY = "65534"
START_S, END_S, TURN_S = 40.0, 30.0, 300.0
THEIR_LOCK = Path("/tmp/linuxcnc.lock")
"""LinuxCNC's own: it asks a person when it is there at the start."""
TASK = "milltask"


def why_not() -> str:
    """Why LinuxCNC cannot be started here; empty if it can."""
    if shutil.which("linuxcnc") is None:
        return "LinuxCNC is not installed (Debian: apt-get install linuxcnc-uspace)"
    asked = [PYTHON, "-c", "import linuxcnc, hal"]
    if not Path(PYTHON).exists() or subprocess.run(asked, capture_output=True).returncode != 0:
        return f"{PYTHON} has no modules linuxcnc and hal"
    return ""


class LinuxCnc:
    """One LinuxCNC with the files of a folder."""

    def __init__(self, ini: Path) -> None:
        self.ini = ini
        self.env: Mapping[str, str] = {}
        self._rtapi = ""
        self._process: subprocess.Popen[bytes] | None = None
        self._turn: int | None = None

    def start(self) -> None:
        """Start it and wait until its task runs; raises OSError if it cannot.

        Waits for its turn: two on one computer would share their memory.
        """
        if reason := why_not():
            raise OSError(reason)
        self._take_turn()
        try:
            if os.geteuid() == 0 and not self._rtapi:
                # Its real-time part lets go of root, and needs a place where it may write.
                self._rtapi = tempfile.mkdtemp(prefix="pkmcal-lcnc-")
                Path(self._rtapi).chmod(0o777)
                self.env = {"RTAPI_UID": NOBODY, "RTAPI_FIFO_PATH": f"{self._rtapi}/fifo"}
            if THEIR_LOCK.exists():
                raise OSError("another LinuxCNC runs on this computer")
            (self.ini.parent / "running").write_text(str(os.getpid()), encoding="ascii")
            with (self.ini.parent / "linuxcnc.log").open("ab") as log:
                self._process = subprocess.Popen(
                    ["linuxcnc", "-r", str(self.ini)], stdin=subprocess.DEVNULL, stdout=log,
                    stderr=log, cwd=self.ini.parent, env={**os.environ, **self.env},
                    start_new_session=True,
                )  # fmt: skip
            self._wait_until_it_runs()
        except BaseException:
            self.stop()
            raise

    def _take_turn(self) -> None:
        if self._turn is not None:
            return
        import fcntl  # not on Windows, where stations without LinuxCNC run

        lock = os.open(Path(tempfile.gettempdir()) / "pkmcal-linuxcnc.lock", os.O_CREAT | os.O_RDWR)
        deadline = time.monotonic() + TURN_S
        while True:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() > deadline:
                    os.close(lock)
                    raise OSError("another station keeps LinuxCNC on this computer") from None
                time.sleep(0.2)
        self._turn = lock

    def _wait_until_it_runs(self) -> None:
        assert self._process is not None
        asked = [PYTHON, "-c", "import linuxcnc; s = linuxcnc.stat(); s.poll(); print(s.joints)"]
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline and self._process.poll() is None:
            if self.task():
                done = subprocess.run(
                    asked, capture_output=True, env={**os.environ, **self.env}, timeout=START_S
                )
                if done.stdout.strip() == b"6":
                    return
            time.sleep(0.1)
        said = (self.ini.parent / "linuxcnc.log").read_text(errors="replace").strip()
        raise OSError(f"LinuxCNC does not start: {said[-500:]}")

    def task(self) -> int:
        """Process id of its task; 0 while there is none."""
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                words = (folder / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if Path(os.fsdecode(words[0])).name == TASK and os.fsencode(self.ini) in words:
                return int(folder.name)
        return 0

    def kill_task(self) -> None:
        """Its task dies, as by a crash."""
        if task := self.task():
            os.kill(task, signal.SIGKILL)

    def restart(self) -> None:
        """End it and start it again, with what its files say now."""
        self._end()
        self.start()

    def stop(self) -> None:
        """End it, and let the next one have its turn."""
        self._end()
        shutil.rmtree(self._rtapi, ignore_errors=True)
        self._rtapi = ""
        if self._turn is not None:
            os.close(self._turn)
            self._turn = None

    def _end(self) -> None:
        process, self._process = self._process, None
        (self.ini.parent / "running").unlink(missing_ok=True)
        if process is None:
            return
        for sent in (None, signal.SIGTERM, signal.SIGKILL):
            if sent is not None:
                process.send_signal(sent)
            try:
                process.wait(END_S)
                return
            except subprocess.TimeoutExpired:
                continue
