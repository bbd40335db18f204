"""What ``pkmcal mock`` is told; light, so that its help is shown at once."""

import argparse
from pathlib import Path

MACHINES = ("hexapod", "tripod", "ptm")
"""Machines that there are mocks of."""
GAUGES = ("dial", "bar", "touch")
"""Gauges that there are mocks of."""
WITH_OWN_FILES = ("hexapod", "ptm")
"""Mechanisms whose mock takes a machine file of one's own: those with a controller on CANopen."""


def hidden_number(text: str) -> tuple[str, float]:
    """NAME=VALUE; raises :class:`argparse.ArgumentTypeError`."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f'"{text}" is no NAME=VALUE') from None


def parser() -> argparse.ArgumentParser:
    """What ``pkmcal mock`` understands."""
    parser = argparse.ArgumentParser(
        prog="pkmcal mock",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "machine", metavar="MACHINE",
        help=f"{', '.join(MACHINES)}, or a machine file of one's own with the mechanism of "
        f"{' or '.join(WITH_OWN_FILES)} (with --eds)",
    )  # fmt: skip
    parser.add_argument(
        "--eds", type=Path,
        help="its controller's EDS file, as pkmcal machine eds writes it",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=1, help="draws truth, room and noise")
    parser.add_argument("--scale", type=float, default=1.0, help="machine s per wall s")
    parser.add_argument("--json", action="store_true", help="print one line of JSON")
    parser.add_argument("--truth", type=Path, help="true parameters (TOML or JSON)")
    parser.add_argument("--hidden", type=Path, help="hidden effects (TOML or JSON)")
    parser.add_argument(
        "--effect", action="append", type=hidden_number, metavar="NAME=VALUE", default=[],
        help="a hidden effect, backlash.leg3=0.015 for instance; repeatable (docs/mocks.md)",
    )  # fmt: skip
    parser.add_argument("--nvm", type=Path, help="file of the controller's stored parameters")
    parser.add_argument("--serial", type=int, help="of the controller; else one for each --nvm")
    parser.add_argument(
        "--smrs", type=int, choices=[1, 3], default=1, help="SMRs for the platform's nests"
    )
    parser.add_argument("--no-base-smrs", action="store_true", help="base nests are empty")
    parser.add_argument(
        "--lines", action="store_true",
        help="the tracker only sends x y z lines (the driver of examples/line_tracker)",
    )  # fmt: skip
    parser.add_argument(
        "--geocom", action="store_true",
        help="the tracker is a total station that speaks GeoCOM (kind geocom)",
    )  # fmt: skip
    parser.add_argument(
        "--gauge", choices=GAUGES,
        help="no tracker: a dial gauge or a touch probe on a plate, or a ball bar between nests, "
        "on a line",
    )  # fmt: skip
    parser.add_argument(
        "--pose", action="store_true",
        help="hexapod: a closed controller that takes poses over GCS and shows no parameters",
    )  # fmt: skip
    parser.add_argument(
        "--bare", action="store_true",
        help="CiA 402 drives alone, without a controller (kind drives)",
    )  # fmt: skip
    parser.add_argument(
        "--linuxcnc", type=Path, metavar="FOLDER",
        help="hexapod: LinuxCNC itself, which must be installed, with its files in FOLDER",
    )  # fmt: skip
    parser.add_argument(
        "--noise-tau", type=float, default=1.0, metavar="S",
        help="how slow the slow part of the tracker's noise is; above 10 s readings err alike",
    )  # fmt: skip
    parser.add_argument("--payload", type=float, default=0.0, help="kg")
    for name in ("controller", "tracker", "control"):
        parser.add_argument(
            f"--{name}-port", type=int, default=0, help="TCP port; a free one if left out"
        )
    parser.add_argument("--site", type=Path, help="write a site file here")
    parser.add_argument("--until-stdin-closes", action="store_true", help="end with the parent")
    return parser
