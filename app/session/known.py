"""What the controller should hold: the parameter sets that this program knows of, by machine.

Every set that was read before a change, or written, is a file (a *snapshot*) that is never
changed. The last set that was left in the controller is the one that is expected at connect; a
machine that has never been changed is expected to hold the machine file's nominal values.
"""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from app.files.site import Site
from app.files.text import read_text
from app.hosted.controller import HostedController
from app.ownership import state_folder
from app.surely import write_surely
from calib.errors import BadInput
from drivers.errors import ParameterError
from drivers.interface import Identity, MotionController

FORMAT = "pkm-parameters/1"


@dataclass(frozen=True)
class Held:
    """Parameters as the controller answered them, with its checksum (CRC-32).

    ``own`` holds the texts of the operator's own effects among them, by id: a host has such.
    """

    values: dict[str, float]
    checksum: int
    own: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Snapshot:
    """One parameter set of one controller, with when and why it was taken."""

    number: int
    taken_utc: str
    why: str
    machine: str
    identity: Identity
    checksum: int
    values: dict[str, float]
    own: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> str:
        """Render the snapshot; numbers are written so that they read back bit for bit."""
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=1)

    @staticmethod
    def from_json(text: str, source: str) -> "Snapshot":
        """Read a snapshot; raises :class:`BadInput` if the text is not one."""
        try:
            data = json.loads(text)
            if data.pop("format") != FORMAT:
                raise ValueError("another format")
            data["identity"] = Identity(**data["identity"])
            data["values"] = {str(k): float(v) for k, v in data["values"].items()}
            data["own"] = {str(k): str(v) for k, v in data.get("own", {}).items()}
            return Snapshot(**data)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise BadInput(
                f"not a parameter snapshot ({error})",
                place=source,
                remedy="It was edited or torn: move it away; pkmcal undo names the others",
            ) from error


class Snapshots:
    """The snapshots of one controller, in a folder of their own."""

    def __init__(self, machine: str, identity: Identity, root: Path | None = None) -> None:
        who = re.sub(r"[^A-Za-z0-9_.-]+", "_", f"{machine}-{identity.serial or 'no-serial'}")
        self.folder = (root or state_folder() / "parameters") / who
        self._machine = machine
        self._identity = identity

    def all(self) -> list[Snapshot]:
        """Every snapshot, the oldest first."""
        paths = sorted(self.folder.glob("[0-9]*.json"))
        return [Snapshot.from_json(read_text(path), str(path)) for path in paths]

    def path(self, snapshot: Snapshot) -> Path:
        """File of a snapshot."""
        return self.folder / f"{snapshot.number:04d}.json"

    def save(self, held: Held, why: str) -> Snapshot:
        """Write a new snapshot; it is on the disk when this returns."""
        self.folder.mkdir(parents=True, exist_ok=True)
        number = max((snapshot.number for snapshot in self.all()), default=0) + 1
        snapshot = Snapshot(
            number,
            datetime.now(UTC).isoformat(timespec="seconds"),
            why,
            self._machine,
            self._identity,
            held.checksum,
            dict(held.values),
            dict(held.own),
        )
        write_surely(self.path(snapshot), snapshot.to_json(), private=True)
        return snapshot

    def get(self, number: int) -> Snapshot:
        """One snapshot by its number; raises :class:`BadInput` for one that is not there."""
        for snapshot in self.all():
            if snapshot.number == number:
                return snapshot
        raise BadInput(
            f"no snapshot {number}",
            place=str(self.folder),
            remedy="pkmcal undo --list shows those there are",
        )

    # what the controller should hold now

    def expect(self, held: Held) -> None:
        """Remember what was left in the controller; clears the latch."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_surely(self.folder / "expected.json", json.dumps(asdict(held)), private=True)
        (self.folder / "unknown").unlink(missing_ok=True)

    def expected(self) -> Held | None:
        """What was last left in the controller; None if this program never changed it."""
        path = self.folder / "expected.json"
        if not path.is_file():
            return None
        data = json.loads(read_text(path))
        values = {k: float(v) for k, v in data["values"].items()}
        return Held(values, int(data["checksum"]), dict(data.get("own", {})))

    def latch_unknown(self, why: str) -> None:
        """Remember that nobody knows what the controller holds; blocks motion until undone."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_surely(self.folder / "unknown", why, private=True)

    def unknown(self) -> str:
        """Why the parameters are unknown; empty if they are not."""
        path = self.folder / "unknown"
        return read_text(path) if path.is_file() else ""


async def read_held(site: Site, controller: MotionController) -> Held:
    """Read all parameters and check that they are all there and numbers.

    Raises
    ------
    ParameterError
        Naming what is missing, not finite, or changed while it was read.
    """
    before = await controller.parameter_checksum()
    values = await controller.read_parameters()
    after = await controller.parameter_checksum()
    names = [parameter.name for parameter in site.machine.parameters]
    missing = [name for name in names if name not in values]
    if missing:
        raise ParameterError(
            f"answers {len(names) - len(missing)} of {len(names)} parameters; missing: "
            f"{', '.join(missing[:5])}",
            device="controller",
            remedy="Check that this is the machine of the site file and its firmware is complete",
        )
    odd = [name for name, value in values.items() if not math.isfinite(value)]
    if odd:
        raise ParameterError(
            f"parameter {odd[0]} is {values[odd[0]]}, not a finite number",
            device="controller",
            remedy="Bring an earlier set back with pkmcal undo, or the maker's defaults",
        )
    if before != after:
        raise ParameterError(
            "its parameters changed while they were read",
            device="controller",
            remedy="Make sure that nothing else writes to the controller, then try again",
        )
    return Held(values, after, own_effects_in(controller))


def own_effects_in(controller: MotionController) -> dict[str, str]:
    """Texts of the operator's own effects that are compensated, by id; only a host has any."""
    return dict(controller.chosen.own) if isinstance(controller, HostedController) else {}


async def compare_with_known(
    site: Site, controller: MotionController, trial: Mapping[str, float] | None = None
) -> Held:
    """Read the controller's parameters and refuse any that are not those expected.

    ``trial`` is what a write-back has just put into volatile memory, to be tried.

    Raises
    ------
    ParameterError
        Naming the first that differs, what was expected, and how to accept or undo it.
    """
    snapshots = Snapshots(site.machine.name, controller.identity)
    why = snapshots.unknown()
    if why:
        raise ParameterError(
            f"its parameters are unknown: {why}",
            device="controller",
            remedy="Bring a known set back with pkmcal undo --to; motion is blocked until then",
        )
    held = await read_held(site, controller)
    expected = Held(dict(trial), held.checksum) if trial else snapshots.expected()
    wanted = expected.values if expected else _nominal(site, held.values)
    names = dict.fromkeys((*held.values, *wanted))
    different = [name for name in names if held.values.get(name) != wanted.get(name)]
    if different:
        name = different[0]
        raise ParameterError(
            f"holds {name} = {held.values.get(name)!r} where the model expects "
            f"{wanted.get(name)!r} ({len(different)} of {len(names)} parameters differ)",
            device="controller",
            remedy="Bring the known set back with pkmcal undo, or take what it holds as known: "
            "pkmcal undo --accept",
        )
    if expected and expected.checksum != held.checksum:
        raise ParameterError(
            f"its checksum is {held.checksum:#010x} where {expected.checksum:#010x} was left",
            device="controller",
            remedy="Bring the known set back with pkmcal undo",
        )
    return held


def _nominal(site: Site, held: Mapping[str, float]) -> dict[str, float]:
    """Nominal geometry, and compensation values at zero."""
    nominal = dict.fromkeys(held, 0.0)
    nominal.update({p.name: p.nominal for p in site.machine.parameters})
    return nominal
