"""The rows: what is in a run, what was once said of it, and what is to be said."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from bench._rows_held import (
    never_worse,
    of_the_drift,
    of_the_labels,
    of_the_nest,
    of_the_period,
    of_the_scatter,
    of_the_sign,
    sober,
    told,
)  # fmt: skip
from bench._rows_spoilt import (
    Spoil,
    as_it_is,
    drifting,
    exchanged,
    in_degrees,
    in_metres,
    legs_exchanged,
    loose,
    mirrored,
    scattering,
    tide,
    twisted,
)  # fmt: skip

LEGS = [f"leg{k}" for k in range(1, 7)]
Effects = Mapping[str, float]


@dataclass(frozen=True)
class Row:
    """A gap: how its runs are simulated, what is to be named, and what more is to hold.

    ``spoil`` changes the rows of ``points.csv``; ``holds`` says what of an answer is wrong, empty
    if nothing is; ``beside``: another run of the same machine without the effect is given, too,
    ``without_load``: with the effect, but without ``[load]``. ``refused``: the run is refused with
    these words. ``anything``: what is named is not held against it.
    """

    name: str
    was: str
    machine: str = "hexapod"
    effects: Effects = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    named: tuple[str, ...] = ()
    spoil: Spoil = as_it_is
    holds: Callable[[dict[str, Any]], str] = lambda answer: ""
    beside: bool = False
    without_load: bool = False
    refused: str = ""
    anything: bool = False

    @property
    def command(self) -> str:
        """What makes a run of it."""
        effects = "".join(f" --effect {name}={value:g}" for name, value in self.effects.items())
        options = "".join(f" --{name} {value:g}" for name, value in self._plain())
        return f"simulate {self.machine}{options}{effects}"

    def _plain(self) -> list[tuple[str, float]]:
        flat = []
        for name, value in self.options.items():
            several = value if isinstance(value, tuple) else (value,)
            flat += [(name, float(one)) for one in several]
        return flat


ROWS = (
    Row(
        "tracker encoder, once per turn",
        "tracker-offset",
        effects={"tracker-encoder.azimuth.sin": 1.5e-4},
        named=("tracker-encoder",),
        holds=told,
    ),
    Row(
        "warm-up, exp(-t/40 min)",
        "thermal-growth",
        effects={"warm-up.A": 0.06, "warm-up.tau": 2400.0},
        named=("warm-up",),
    ),
    Row(
        "one side warmer: legs 1 and 2",
        "frame-shift, or thermal-growth and tracker-offset",
        effects={"leg-warming.leg1": 0.006, "leg-warming.leg2": 0.006},
        named=("leg-warming",),
    ),
    Row(
        "index slip of one leg",
        "-",
        effects={"actuator-step.leg4": 0.03, "actuator-step.t0": 700.0},
        named=("actuator-step",),
    ),
    Row(
        "stick-slip",
        "-",
        named=("stick-slip",),
        effects={**{f"stick-slip.{leg}": 0.025 for leg in LEGS}, "stick-slip.reach": 4.0},
    ),
    Row(
        "loaded backlash",
        "-",
        options={"payload": (0.0, 12.0)},
        named=("loaded-backlash",),
        effects={f"loaded-backlash.{leg}": 1e-3 for leg in LEGS},
    ),
    Row(
        "one-sided contact",
        "-",
        named=("contact",),
        effects={"contact.leg2": 2e-3, "contact.at": 0.6, "contact.side": 1.0},
    ),
    Row(
        "warm-up of one leg",
        "-",
        named=("leg-warm-up",),
        effects={"leg-warm-up.leg5": 0.08, "leg-warm-up.tau": 900.0},
    ),
    Row("warming of one leg", "-", effects={"leg-warming.leg5": 0.008}, named=("leg-warming",)),
    Row(
        "compliance of one leg",
        "-",
        options={"payload": (0.0, 12.0)},
        named=("leg-compliance",),
        effects={"leg-compliance.leg3": 1.5e-3},
    ),
    Row(
        "the tracker moved in the first of two runs",
        "wrong or nothing in 5 of 8",
        beside=True,
        effects={
            "frame-shift.x": 0.04,
            "frame-shift.rz": 1e-4,
            "frame-shift.t0": 700.0,
            "frame-shift.where": 1.0,
        },
        named=("frame-shift",),
    ),
    Row(
        "eccentric encoder of the ptm, 1.5 mrad",
        "screw-pitch, without a warning",
        machine="ptm",
        effects={"screw-cyclic.limb1.sin": 1.5e-3},
        named=("screw-cyclic",),
    ),
    Row(
        "ptm, nothing hidden",
        "redundancy raises RMS from 8.35 to 9.90 um",
        machine="ptm",
        holds=never_worse,
    ),
    Row(
        "a loose reference nest",
        "3 to 6 of 7 readings dropped, 'to their noise'",
        spoil=loose,
        holds=of_the_nest,
    ),
    Row(
        "growth with a negative sign",
        "named without a word",
        effects={"thermal-growth.a": -3e-5},
        named=("thermal-growth",),
        holds=of_the_sign,
    ),
    Row(
        "nests 4 and 5 exchanged throughout",
        "160 of 268 readings excluded, two effects named",
        effects={"backlash.leg3": 0.03},
        named=("backlash",),
        spoil=exchanged,
        holds=of_the_labels,
    ),
    Row(
        "sides of a parallelogram differ (tripod)",
        "-0.0012 +- 29 mm",
        machine="tripod",
        effects={"parallelogram-sides.limb1": 0.1},
        named=("parallelogram-sides",),
        holds=sober,
    ),
    Row(
        "step of the frame: its moment",
        "t0 = 1346 +- 1,250,000 s",
        effects={"frame-shift.y": 0.03, "frame-shift.t0": 700.0, "frame-shift.where": 1.0},
        named=("frame-shift",),
        holds=sober,
    ),
    Row(
        "screws of the stewart platform, 2 mm a turn",
        "no known effect explains",
        machine="stewart",
        named=("screw-twist",),
        spoil=twisted,
    ),
    Row(
        "backlash with a negative sign",
        "named without a word",
        effects={"backlash.leg3": -0.03},
        named=("backlash",),
        holds=of_the_sign,
    ),
    Row(
        "sag with a negative sign",
        "named without a word",
        options={"payload": (0.0, 12.0)},
        effects={"gravity-sag.c": -3e-4},
        named=("gravity-sag",),
        holds=of_the_sign,
    ),
    Row(
        "sag, and a second run that states no load",
        "not asked",
        options={"payload": (0.0, 12.0)},
        effects={"gravity-sag.c": 3e-4},
        named=("gravity-sag",),
        without_load=True,
    ),
    Row(
        "a tide of 50.03 s",
        "51.2 or 28 s",
        spoil=tide,
        holds=of_the_period,
    ),
    Row(
        "the tracker goes 40 um and comes back, slowly",
        "-",
        spoil=drifting,
        holds=of_the_drift,
        anything=True,
    ),
    Row("nest 4 scatters four times as much as is stated", "-", spoil=scattering,
        holds=of_the_scatter),
    Row("columns q2 and q5 exchanged", "-", spoil=legs_exchanged,
        refused="q2 and q5 are exchanged"),
    Row("y of the tracker has the other sign", "-", spoil=mirrored, refused="left-handed"),
    Row("z of the tracker in m", "-", spoil=in_metres, refused="z looks like m"),
    Row("q2 of the ptm in degrees", "-", machine="ptm", spoil=in_degrees,
        refused="look like degrees"),
)  # fmt: skip
