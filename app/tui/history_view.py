"""What the History screen looks at: the machines of the folder, and which of them."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING

from app.tui.picture import Picture

if TYPE_CHECKING:
    from app.jobs.looking_back import HistoryReport, MachineEntry, SeriesEntry


class LookingBack:
    """The history of the folder in which the sessions lie; it is only read."""

    def __init__(self, root: Path, picture: Picture) -> None:
        self._root = root
        self._picture = picture
        self.found: HistoryReport | None = None
        self._which = 0

    async def look(self, serial: str = "", tolerance_um: float | None = None) -> None:
        """Read it anew; the machine with this controller is shown, if it is among them."""

        def read() -> "HistoryReport":
            from app.jobs.looking_back import history_of

            return history_of(self._root, tolerance_um=tolerance_um)

        self.found = await asyncio.to_thread(read)
        serials = [machine.serial for machine in self.found.machines]
        self._which = serials.index(serial) if serial in serials else max(0, len(serials) - 1)
        self._picture.revision += 1

    def next_machine(self) -> None:
        """Show the next machine."""
        self._which += 1
        self._picture.revision += 1

    @property
    def machine(self) -> "MachineEntry | None":
        """The machine that is shown."""
        if self.found is None or not self.found.machines:
            return None
        return self.found.machines[self._which % len(self.found.machines)]

    @property
    def place(self) -> tuple[int, int]:
        """Which machine of how many."""
        count = len(self.found.machines) if self.found is not None else 0
        return (self._which % count + 1 if count else 0), count


def series_of(machine: "MachineEntry | None") -> "list[SeriesEntry]":
    """What is worth a look first: the largest error, what changed or drifts, then the rest."""
    if machine is None:
        return []
    errors = [machine.errors] if machine.errors is not None else []

    def rank(one: "SeriesEntry") -> tuple[bool, float]:
        moves = one.changed or (one.drift is not None and one.drift.clear)
        return not moves, one.p_value if one.p_value is not None else 1.0

    return [*errors, *sorted(machine.parameters, key=rank)]
