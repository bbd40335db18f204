"""Describe a machine, check what its file says, draw it"""

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.analysis_options import machine_options
from app.machine_templates import TEMPLATES
from app.show.completion_words import completion_words
from calib.errors import BadInput
from calib.quantity import quantity

if TYPE_CHECKING:
    from calib.mechanism.description import Machine
    from calib.mechanism.solve import Configuration


@click.group()
def command() -> None:
    """Describe a machine in a file, check it, and look at it."""


@command.command()
@machine_options
@click.option(
    "--seed",
    type=click.IntRange(0),
    default=1,
    show_default=True,
    help="Seed of the poses that are tried.",
)
@answer.json_option
def check(machine_name: str, closure: str, seed: int, as_json: bool) -> None:
    """Say in words what a machine file describes, or what is wrong with it.

    Closure at home, mobility, constraints and redundancy, rank, limits and what of the workspace
    they keep out of reach. A file that cannot work ends with exit code 2, the line and a remedy.
    """
    from app.jobs.inspecting import check_machine

    found = check_machine(machine_name, closure=closure, seed=seed)
    answer.show(found.to_json(), as_json, found.text)


@command.command()
@machine_options
@click.option("--at", "pose", default="", help='A pose: "x=10 rz=5deg"; home if not given.')
@click.option("--out", type=answer.WrittenFile(), help="Write a figure (png, svg, pdf).")
def draw(machine_name: str, closure: str, pose: str, out: Path | None) -> None:
    """Draw limbs and joints: into a figure, or from two sides in the terminal."""
    import numpy as np

    from app.files.machines import closed_machine
    from app.show.braille import plain
    from app.show.machine_drawing import draw_figure
    from app.show.machine_sketch import draw_text
    from calib.analysis.skeleton import skeleton

    machine = closed_machine(machine_name, closure)
    configuration = _configuration(machine, pose)
    shape = skeleton(machine, configuration)
    if out:
        draw_figure(shape, f"{machine.name}: {machine.says}", out)
        answer.say(f"written to {out}")
        return
    size = shutil.get_terminal_size((80, 24))
    drawing = draw_text(shape, min(size.columns, 160), max(10, min(size.lines - 4, 40)))
    click.echo(plain(drawing, sys.stdout.encoding))
    x, y, z, *angles = np.round(configuration.poses.to_xyz_rpy()[:, 0], 6) + 0.0
    turned = ", ".join(f"{np.rad2deg(a):.2f}" for a in angles)
    click.echo(f"platform at {x:.2f}, {y:.2f}, {z:.2f} mm; rx, ry, rz {turned} deg")


def _configuration(machine: "Machine", pose: str) -> "Configuration":
    from calib.mechanism.solve import home_configuration, inverse
    from calib.mechanism.task import task_values

    home = home_configuration(machine)
    if not pose:
        return home
    values = task_values(machine.task, home.poses)[:, 0]
    for item in pose.replace(",", " ").split():
        name, equals, text = item.partition("=")
        if name not in machine.task.coordinates or not equals:
            raise BadInput(
                f'"{item}" in --at',
                remedy=f'Write "{machine.task.coordinates[0]}=10"; this machine commands '
                f"{', '.join(machine.task.coordinates)}.",
            )
        unit = "mm" if name in "xyz" else "rad"
        values[machine.task.coordinates.index(name)] = quantity(text, unit, "--at")
    found = inverse(machine, values[:, None])
    if not found.converged[0]:
        raise BadInput("the machine does not close at this pose", remedy="Choose a pose in reach.")
    return found


@command.command()
@click.argument("machine_name", metavar="MACHINE")
@click.option("--tool", is_flag=True, help="Errors behind the last joint of an arm as well.")
@click.option(
    "--out",
    type=answer.WrittenFile(),
    help="Write the whole machine file with what it lacks.",
)
@answer.json_option
def complete(machine_name: str, tool: bool, out: Path | None, as_json: bool) -> None:
    """Find the errors that no parameter of a machine file imitates, and propose them.

    Six errors, three places and three directions, are put at the base of every chain and behind
    every joint; by rank it follows which of them the file's parameters and the base frame do not
    imitate. They are proposed in the file's own words. Errors behind the last joint of an arm are
    where the nests are on its flange: with --tool they are proposed, too.
    """
    from app.jobs.completing import complete as completed

    found = completed(machine_name, tool=tool)
    if out is not None:
        if out.exists():
            raise BadInput("there is such a file already", place=str(out), remedy="Name another")
        out.write_text(found.text, encoding="utf-8", newline="\n")
        answer.say(f"written to {out}")
    answer.show(found.to_json(), as_json, completion_words(found.to_json()))


@command.command(name="import")
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False), metavar="ARM.urdf")
@click.option("--out", type=answer.WrittenFile(), required=True, help="Machine file to write.")
@click.option("--name", default="", help="Name of the machine.  [default: the robot's]")
@click.option("--base", default="", help="Link to begin with.  [default: the root]")
@click.option("--tip", default="", help="Link to end with.  [default: the only end]")
@click.option(
    "--loops",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="List of constraints that close the loops of a parallel machine.",
)
@click.option("--tolerance", default="0.5 mm", show_default=True, help="Of errors of place.")
@click.option("--angle", default="0.2 deg", show_default=True, help="Of errors of direction.")
@click.option("--tool", is_flag=True, help="Errors of the nests on the flange as well.")
@click.option("--force", is_flag=True, help="Overwrite the file.")
def import_(
    file: Path,
    out: Path,
    name: str,
    base: str,
    tip: str,
    loops: Path | None,
    tolerance: str,
    angle: str,
    tool: bool,
    force: bool,
) -> None:
    """Make a machine file of what a URDF describes: a serial chain, or a parallel machine.

    Joints become q1, q2, ... in their order, fixed joints are part of the links, joints that mimic
    others follow them. A URDF is a tree: where loops close, which joints are driven, and what is
    commanded, stands in the list of --loops (docs/machine-files.md), or in elements that export
    --as urdf writes. The errors that a calibration can see are put in by rank, as pkmcal machine
    complete does; home is a pose far from singular ones. xacro files are expanded first.
    """
    from app.files.machines import load_machine
    from app.jobs.urdf import LEFT_OUT, machine_of_urdf

    if out.exists() and not force:
        raise BadInput("there is such a file already", place=str(out), remedy="Add --force.")
    text = machine_of_urdf(
        file,
        name=name,
        base=base,
        tip=tip,
        loops=loops,
        tolerance_mm=quantity(tolerance, "mm", "--tolerance"),
        tolerance_rad=quantity(angle, "rad", "--angle"),
        tool=tool,
    )
    out.write_text(text, encoding="utf-8", newline="\n")
    machine = load_machine(str(out))
    answer.say(f"written to {out}")
    for line in text.splitlines():
        if line.startswith(LEFT_OUT):
            click.echo(f"{line[2:3].upper()}{line[3:]}.")
    click.echo(
        f"{machine.name}: {len(machine.actuators)} actuators, {len(machine.parameters)} parameters."
        f"\nNext: pkmcal machine draw {out}; pkmcal machine check {out}"
    )


@command.command()
@machine_options
@click.option(
    "--out",
    type=answer.WrittenFile(),
    help="Where it is written.  [default: NAME_controller.eds]",
)
@click.option("--force", is_flag=True, help="Overwrite the file.")
def eds(machine_name: str, closure: str, out: Path | None, force: bool) -> None:
    """Write the EDS file of a machine's controller on CANopen.

    Its object dictionary follows from the machine file: an entry for each parameter, its default
    the nominal value, compensation values, motion and limits of every actuator. The site file
    names it: eds = "NAME_controller.eds" in [controller]. docs/protocols/canopen.md says what
    each object does.
    """
    from app.files.machines import closed_machine
    from mocks.canopen.make_eds import controller_eds

    machine = closed_machine(machine_name, closure)
    name, text = controller_eds(machine)
    path = out or Path(name)
    if path.exists() and not force:
        raise BadInput("there is such a file already", place=str(path), remedy="Add --force.")
    path.write_text(text, encoding="utf-8")
    answer.say(f"written to {path}")
    click.echo(f'In [controller] of the site file: kind = "canopen", eds = "{path.name}"')


class Asked:
    """Answers given by ``--set``, else those of the person, else the defaults."""

    def __init__(self, given: dict[str, str], quiet: bool) -> None:
        self.given, self.quiet, self.known = given, quiet, list[str]()

    def number(self, name: str, question: str, default: float) -> float:
        """Ask for a number."""
        text = self.text(
            name, question, f"{default:g}" if default == round(default, 3) else f"{default!r}"
        )
        return quantity(float(text) if _is_number(text) else text, "", f"{name} = {text}")

    def text(self, name: str, question: str, default: str) -> str:
        """Ask for a text."""
        self.known.append(name)
        if name in self.given:
            return self.given[name]
        if self.quiet:
            return default
        answered: str = click.prompt(f"{question}", default=default, err=True)
        return answered

    def check(self) -> None:
        """Refuse values that nobody asked for."""
        for name in self.given:
            if name not in self.known:
                raise BadInput(
                    f'--set {name}: nobody asked for "{name}"',
                    remedy=f"Asked were {', '.join(self.known)}.",
                )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@command.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--kind", type=click.Choice([t.name for t in TEMPLATES]), help="Kind of machine.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Answer beforehand.")
@click.option("--yes", is_flag=True, help="Take the defaults for everything else.")
@click.option("--force", is_flag=True, help="Overwrite the file.")
def new(file: Path, kind: str | None, settings: tuple[str, ...], yes: bool, force: bool) -> None:
    """Ask a few questions and write a commented machine file.

    The file is a beginning: put your own joint centres, limits and tolerances into it. What is
    written is checked at once.
    """
    import numpy as np

    from app.files.machines import load_machine
    from calib.analysis.inspection import inspect

    if file.exists() and not force:
        raise BadInput("there is such a file already", place=str(file), remedy="Add --force.")
    given = dict(_setting(s) for s in settings)
    if kind is None:
        for template in TEMPLATES:
            answer.say(f"  {template.name:8} {template.says}")
        names = click.Choice([t.name for t in TEMPLATES])
        kind = "own" if yes else click.prompt("kind of machine", type=names, err=True)
    template = next(t for t in TEMPLATES if t.name == kind)
    asked = Asked(given, yes)
    text = template.render(file.stem, asked)
    asked.check()
    file.write_text(text, encoding="utf-8")
    answer.say(f"written to {file}")
    try:
        machine = load_machine(str(file))
    except BadInput as wrong:
        # The file is the person's to finish: its first fault is the next thing to do.
        click.echo(f"It does not work yet: {wrong}")
        return
    found = inspect(machine, np.random.default_rng(1))
    click.echo(
        f"It closes. Limbs: {len(machine.limbs)}, actuators: {len(machine.actuators)}, "
        f"parameters: {len(machine.parameters)}; {100 * found.reach:.0f} % of its workspace box is "
        f"within reach.\nNext: pkmcal machine draw {file}; pkmcal machine check {file}"
    )


def _setting(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise BadInput(f'--set "{text}"', remedy="Write --set NAME=VALUE.")
    return name, value
