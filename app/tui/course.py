"""How far the calibration of the machine has come: ticks, as found and as left, the record."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from app.files.site import Site
from app.tui.picture import Picture
from app.tui.standing import standing_of
from app.tui.study import Study
from app.tui.verifying import Verified, verified


class Course:
    """From as found to the record, once round; the next run that is measured begins another round.

    ``done`` holds ``found``, ``applied``, ``left`` and ``record``. ``before`` stands beside
    ``after`` on the Verify screen. What is verified again without anything written in between takes
    the place of ``after``: ``before`` stays what the machine was found as.
    """

    def __init__(self, root: Path, picture: Picture, study: Study) -> None:
        self._root = root
        self._picture = picture
        self._study = study
        self._written = False
        self._chosen = False
        self.done: set[str] = set()
        self.before: Verified | None = None
        self.after: Verified | None = None

    def begin(self) -> None:
        """Another machine: nothing is done yet."""
        self.done.clear()
        self.before = self.after = None
        self._written = self._chosen = False

    async def recall(self, serial: str, in_use: int | None) -> None:
        """Go on where the program was left, with what lies in the folder of the sessions.

        Raises
        ------
        BadInput
            If the history or a verification cannot be read.
        """
        if self.done or self.after is not None:
            return

        def read() -> tuple[frozenset[str], Path | None, Verified | None, Verified | None]:
            standing = standing_of(self._root, serial, in_use)
            found = verified(standing.found) if standing.found is not None else None
            left = verified(standing.left) if standing.left is not None else None
            return standing.done, standing.run, found, left

        done, run, found, left = await asyncio.to_thread(read)
        self.done |= done
        self.before, self.after = (found, left) if left is not None else (None, found)
        self._written = "applied" in done and left is None
        if run is not None and not self._study.runs:
            self._study.choose((str(run),))
        if done or run is not None:
            self._picture.write("goes on with what lies in the folder of the sessions")
        self._picture.revision += 1

    def measured(self, run: Path) -> None:
        """A run is there: what is written from it begins another round, if one was ended."""
        if "applied" in self.done:
            # As left of the last round is as found of this one.
            self.done = {"found"} if "left" in self.done else set()
        self._study.choose((str(run),))

    def written(self) -> None:
        """A set was written and kept."""
        self.done.add("applied")
        self.done -= {"left", "record"}
        self._written = True

    def undone(self) -> None:
        """An earlier set is back: what the machine is now was not verified."""
        self.done -= {"applied", "left", "record"}
        self._written = True

    async def judge(self, folder: Path) -> None:
        """Judge a finished verification: it is 'after'."""
        self.take(await asyncio.to_thread(verified, folder))

    def take(self, judged: Verified) -> None:
        """Let a verification that was judged be 'after'; what becomes 'before', the class says."""
        if self.after is not None and (self._written or self.before is None):
            self.before, self._chosen = self.after, False
        self.after, self._written = judged, False
        self.done.add("left" if "applied" in self.done else "found")
        self.done.discard("record")
        found = judged.found.measured
        self._picture.write(
            f"verified {len(judged.found.labels)} poses: peak {found.position_peak_um:.1f} µm, "
            f"{found.orientation_peak_deg:.4f} deg",
            "good",
        )

    async def load_before(self, folder: Path) -> None:
        """Let an earlier verification stand as 'before'."""
        self.before, self._chosen = await asyncio.to_thread(verified, folder), True
        self._picture.write(f"before: {folder.name}")

    async def write_record(self, site: Site | None, model: Path, outs: Sequence[Path]) -> None:
        """Write the calibration record of the runs that are studied, beside the other steps.

        Where nothing was written from them, the last verification is what the machine was found as.

        Raises
        ------
        BadInput
            As :func:`app.report.build.write_report`.
        """
        from app.report.build import Asked, write_report  # brings matplotlib: not at start

        asked = Asked(
            model=model,
            mask=self._study.masked,
            before=self.before.folder if self.before is not None else None,
            after=self.after.folder if self.after is not None else None,
            site=site,
        )
        if "applied" not in self.done and not self._chosen:
            asked = replace(asked, before=asked.after or asked.before, after=None)
        await asyncio.to_thread(write_report, self._study.runs, asked, outs)
        self.done.add("record")
        self._picture.write(f"calibration record in {' and '.join(map(str, outs))}", "good")
