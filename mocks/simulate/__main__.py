"""``python -m mocks.simulate hexapod --seed 3 --poses 60 --out RUN``."""

import argparse
import sys
from pathlib import Path

from mocks.physics.hidden import Hidden
from mocks.physics.truth import machine_file, read_parameters
from mocks.simulate.files import read_poses, write
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m mocks.simulate", description=__doc__)
    parser.add_argument("machine", choices=["hexapod"])
    parser.add_argument("--seed", type=int, default=1, help="draws truth, room, noise, poses")
    parser.add_argument("--poses", default="60", help="a number, or a CSV file x,y,z,rx,ry,rz")
    parser.add_argument("--order", choices=["nest-by-nest", "pose-by-pose"], default="nest-by-nest")
    parser.add_argument("--cycles", type=int, default=1, help="visits of all poses")
    parser.add_argument("--noise-um", type=float, help="per axis; without: a tracker's own")
    parser.add_argument("--hidden", type=Path, help="hidden effects (TOML or JSON)")
    parser.add_argument("--parameters", type=Path, help="true parameters (TOML or JSON)")
    parser.add_argument("--payload", type=float, nargs="+", default=[0.0], help="kg, in turn")
    parser.add_argument("--rise", type=float, default=6.0, help="warming of the structure, K")
    parser.add_argument("--delays", action="store_true", help="write a column delay_s")
    parser.add_argument("--strays", type=int, default=0, help="so many wrong readings")
    parser.add_argument("--title", default="")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run")
    parser.add_argument("--truth", type=Path, help="where the truth goes (default: OUT/truth.json)")
    return parser.parse_args(argv)


def plan_of(options: argparse.Namespace) -> RunPlan:
    """The campaign that the command line asks for; raises ValueError or OSError."""
    poses = options.poses
    parameters = None
    if options.parameters is not None:
        parameters = read_parameters(options.parameters, machine_file(options.machine))
    return RunPlan(
        seed=options.seed,
        poses=int(poses) if poses.isdigit() else read_poses(Path(poses)),
        order=options.order,
        cycles=options.cycles,
        noise_mm=None if options.noise_um is None else 1e-3 * options.noise_um,
        hidden=Hidden() if options.hidden is None else Hidden.read(options.hidden),
        parameters=parameters,
        profile=Profile(rise_K=options.rise, payload_kg=tuple(options.payload)),
        delays=options.delays,
        strays=options.strays,
        title=options.title,
    )


def main(argv: list[str] | None = None) -> int:
    """Write a run; exit code 2 for bad input."""
    options = _arguments(argv)
    try:
        write(simulate(plan_of(options)), options.out, options.truth)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
