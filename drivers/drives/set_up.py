"""What a drive must be told before it may move; all of it is read back."""

from drivers.canopen.drive402 import POSITION_WINDOW, Drive402
from drivers.drives.axis import Axis
from drivers.drives.plan import Plan
from drivers.errors import Refused

ABORT_OPTION, QUICK_STOP_OPTION, LIMITS, HOMING_METHOD = 0x6007, 0x605A, 0x607D, 0x6098
FOLLOWING_WINDOW = 0x6065
OFF = 0xFFFF_FFFF


class SetUp:
    """One drive's settings; :attr:`window` and :attr:`limits` are known after :meth:`run`."""

    def __init__(self, drive: Drive402, axis: Axis, plan: Plan) -> None:
        self.drive = drive
        self._axis = axis
        self._plan = plan
        self.window = 0
        self.limits = axis.limits_in_counts()
        self._found: tuple[int, ...] | None = None

    async def run(self) -> None:
        """Write everything that does not stand there; raises Refused."""
        await self._option(QUICK_STOP_OPTION, self._plan.quick_stop, "brake at a stop as told")
        await self._option(ABORT_OPTION, self._plan.on_silence, "stop when this PC is silent")
        if self._axis.homing_method is not None:
            await self._option(HOMING_METHOD, self._axis.homing_method, "home as told")
        await self._limit()
        self.window = await self._read_window()

    async def _option(self, index: int, value: int, what: str) -> None:
        try:
            if await self.drive.read(index) != value:
                await self.drive.write(index, value)
            held = await self.drive.read(index)
        except Refused as error:
            raise self._cannot(what, index, value, error.what) from error
        if held != value:
            raise self._cannot(what, index, value, f"it holds {held}")

    def _cannot(self, what: str, index: int, value: int, why: str) -> Refused:
        return Refused(
            f"cannot be told to {what} (0x{index:04X} = {value}): {why}",
            device=self.drive.device,
            remedy="Choose a value that its manual lists, under [controller].",
        )

    async def _limit(self) -> None:
        """Let the drive itself hold the limits (0x607D); its own stay where they are narrower."""
        low, high = self._axis.limits_in_counts()
        if self.drive.has(LIMITS, 1) and self.drive.has(LIMITS, 2):
            held = [await self.drive.read(LIMITS, sub) for sub in (1, 2)]
            if self._found is None:
                self._found = tuple(held)
            if held[0] < held[1]:
                low, high = max(low, held[0]), min(high, held[1])
            if low >= high:
                raise Refused(
                    f"has limits {held[0]} to {held[1]} (0x607D), none of it within those of the "
                    "site file",
                    device=self.drive.device,
                    remedy="Check sign, offset and counts_per_unit under [controller].",
                )
            for sub, value in ((1, low), (2, high)):
                if held[sub - 1] != value:
                    await self.drive.write(LIMITS, value, sub)
            now = [await self.drive.read(LIMITS, sub) for sub in (1, 2)]
            if now != [low, high]:
                raise self._cannot("hold limits", LIMITS, low, f"it holds {now}")
        self.limits = low, high

    async def give_back(self) -> None:
        """Let the drive hold the limits that it held before: the next site file may allow more."""
        if self._found is not None and self._found != self.limits:
            for sub, value in enumerate(self._found, start=1):
                await self.drive.write(LIMITS, value, sub)

    async def _read_window(self) -> int:
        if self._plan.window:
            return max(round(self._plan.window * abs(self._axis.scale)), 1)
        for index in (POSITION_WINDOW, FOLLOWING_WINDOW):
            if self.drive.has(index):
                held = await self.drive.read(index)
                if 0 < held < OFF:
                    return held
        raise Refused(
            "does not say how near to its target it has arrived (0x6067, 0x6065)",
            device=self.drive.device,
            remedy="Write window = ... under [controller].",
        )
