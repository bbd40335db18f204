"""A gauge as it is in life: slow, of few digits, with an end to its travel and a battery.

On a line it answers ``?`` with a number. A dial gauge sits in a nest of the platform and touches a
plate on the base, which lies a little off and a little inclined; a telescopic ball bar is set
between a nest of the platform and one of the base. Its zero is its own business. A touch probe
sits in a nest as well, above such a plate, and says only whether it touches.
"""

import asyncio
from typing import Any

import numpy as np

from mocks.clock import ScaledClock
from mocks.listening import TcpDevice
from mocks.world import World

LAG_S = 0.15
"""Machine seconds with which it follows: e-fold."""
NOISE_MM, STEP_MM = 0.0006, 0.001
TRAVEL = {"dial": (0.0, 12.7), "bar": (-25.0, 25.0)}
"""What it can show, mm."""
BAR_WRONG_MM = 0.04
"""What the label of a bar, its length at zero, is off by."""
DIAL_AT_PLATE = 6.35
TRAVEL_MM, REPEATS_MM, BALL_MM, PLATE_BELOW_MM = 0.012, 0.001, 1.0, 8.0
"""Of a touch probe: how far its ball is pushed before it says so, how well that repeats, its
radius; how far the plate is below its ball at home."""
TOUCHES, OPEN = "probe: TRIGGERED", "probe: open"
PLATE_OFF_MM, PLATE_TILT = 0.25, (0.0012, -0.0008)
_BACK = np.linspace(0.0, 4.0, 9)


class GaugeMock:
    """What the gauge shows; ``between`` are the nests that a bar is set between."""

    def __init__(self, world: World, clock: ScaledClock, kind: str) -> None:
        self._world, self._clock, self.kind = world, clock, kind
        self._rng = np.random.default_rng([world.plan.seed, 61])
        self.nest = next(iter(world.around.platform_nests))
        self.between: tuple[str, str] | None = None
        self._last = ""
        self._count = 0
        home = world.nest_in_base(self.nest, np.array([clock.now()]))[0]
        below = PLATE_BELOW_MM + BALL_MM if kind == "touch" else 0.0
        self.plate_z = round(float(home[2]) - below, 1)
        self.bar_mm = self._usual_length(clock.now())

    def _usual_length(self, now: float) -> float:
        """A bar as a shop has it for this machine: about the middle of its pairs at home, mm."""
        around = self._world.around
        at = [self._world.nest_in_base(one, np.array([now]))[0] for one in around.platform_nests]
        far = [np.array(one) for one in around.base_nests.values()]
        return 10.0 * round(float(np.median([np.linalg.norm(a - b) for a in at for b in far])) / 10)

    def span(self, nest: str, nest2: str) -> None:
        """Set it between two nests; raises ValueError for nests that are none."""
        around = self._world.around
        if nest not in around.platform_nests or nest2 not in around.base_nests:
            raise ValueError(f"{nest} and {nest2} are no nests of platform and base")
        self.between = (nest, nest2)

    def line(self) -> str | None:
        """What it answers; None: nothing."""
        faults = self._world.faults
        self._count += 1
        if "gauge-silent" in faults:
            return None
        if "gauge-noise" in faults and self._count % 2:
            return "\x00\xff#7&"
        if "gauge-held" in faults and self._last:
            return self._last
        if self.kind == "touch":
            self._last = self._felt()
            return self._last
        shown = self._shown()
        low, high = TRAVEL[self.kind]
        if shown is None or "gauge-over" in faults or not low <= shown <= high:
            return "ERR 12 OVER RANGE"
        shown = STEP_MM * round((shown + float(self._rng.normal(0.0, NOISE_MM))) / STEP_MM)
        self._last = self._text(-shown if "gauge-reversed" in faults else shown)
        return self._last

    def _felt(self) -> str:
        """Whether the ball is pushed in by more than the probe's travel."""
        if "gauge-dead" in self._world.faults:
            return OPEN
        pushed = BALL_MM - float(self._above(np.array([self._clock.now()]))[0])
        return TOUCHES if pushed > TRAVEL_MM + self._rng.normal(0.0, REPEATS_MM) else OPEN

    def _text(self, shown: float) -> str:
        faults = self._world.faults
        if "gauge-inch" in faults:
            return f"{shown / 25.4:+.5f} in"
        if "gauge-inch-untold" in faults:
            return f"{shown / 25.4:+.5f}"
        return f"{shown:+09.3f} mm"

    def _shown(self) -> float | None:
        """Lagging behind what is true, mm; None where it is set nowhere."""
        now = self._clock.now()
        true = self._true(np.maximum(now - LAG_S * _BACK, 0.0))
        weight = np.exp(-_BACK)
        return None if true is None else float(true @ weight / weight.sum())

    def _true(self, times: np.ndarray[Any, Any]) -> np.ndarray[Any, Any] | None:
        if self.kind == "bar":
            if self.between is None:
                return None
            at = self._world.nest_in_base(self.between[0], times)
            far = np.array(self._world.around.base_nests[self.between[1]])
            return np.asarray(np.linalg.norm(at - far, axis=1) - self.bar_mm - BAR_WRONG_MM)
        return np.asarray(DIAL_AT_PLATE - self._above(times))

    def _above(self, times: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """How far the nest is above the plate, mm."""
        at = self._world.nest_in_base(self.nest, times)
        normal = np.array([*PLATE_TILT, 1.0])
        off = at - [0.0, 0.0, self.plate_z + PLATE_OFF_MM]
        return np.asarray(off @ normal / np.linalg.norm(normal))

    def site(self) -> dict[str, Any]:
        """What a site file says of it, and of the plate that it touches."""
        near = {} if self._world.kind == "hexapod" else {"near": 10.0}  # by their tolerances
        plate = {
            "normal": [0.0, 0.0, 1.0], "through": [0.0, 0.0, self.plate_z], "sigma": 0.5,
            "tilt_sigma": 0.003,
        }  # fmt: skip
        if self.kind == "touch":
            own = {
                **near, "reads": "direction", "nest": self.nest, "plane": "plate", "sigma": 0.001,
                "radius_mm": BALL_MM, "zero_sigma": 0.05, "clearance_mm": 3.0, "name": "probe",
            }  # fmt: skip
            return {"gauge": own, "planes": {"plate": plate}}
        low, high = TRAVEL[self.kind]
        common = {**near, "sigma": 0.002, "lowest": low, "highest": high}
        if self.kind == "bar":
            own = {"reads": "distance", "zero_at": self.bar_mm, "zero_sigma": 0.1, "name": "bar"}
            return {"gauge": {**common, **own}}
        own = {
            "reads": "direction", "nest": self.nest, "plane": "plate", "zero_at": DIAL_AT_PLATE,
            "sign": -1, "zero_sigma": 20.0, "clearance_mm": 8.0, "name": "dial",
        }  # fmt: skip
        return {"gauge": {**common, **own}, "planes": {"plate": plate}}


class GaugeServer(TcpDevice):
    """The gauge's line at ``host:port`` (port 0: any free one); it answers ``?``."""

    def __init__(self, gauge: GaugeMock, host: str = "127.0.0.1", port: int = 0) -> None:
        self.gauge = gauge
        super().__init__(host, port)

    def site(self) -> dict[str, Any]:
        """The tables of a site file."""
        tables = self.gauge.site()
        link = {"kind": "lines", "source": self.address, "ask": "?\\n", "unit": "mm"}
        if self.gauge.kind == "touch":
            del link["unit"]
            link |= {"kind": "contact", "touches": "TRIGGERED", "open": "open"}
        return {**tables, "gauge": {**link, "silence_s": 2.0, **tables["gauge"]}}

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer, or speak, as the device does."""
        while line := await reader.readline():
            if line.strip() == b"?" and (said := self.gauge.line()) is not None:
                writer.write(said.encode("latin-1") + b"\r\n")
                await writer.drain()
