"""The command line: one verb for each of the operator's tasks, loaded only when it is asked for."""

import io
import os
import sys
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

import click

from app.errors import GateRefused, StoppedByOperator
from app.lasting import Lasting
from app.plain_data import printable
from app.tasks import TASKS
from calib.errors import BadInput
from drivers.errors import DeviceError

VERBS = Path(__file__).parent / "verbs"

EXIT_BAD_INPUT = 2
EXIT_DEVICE = 3
EXIT_STOPPED = 4
EXIT_REFUSED = 5


class Verbs(click.Group):
    """Verbs found by their file names in ``app/verbs`` and imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Every verb there is, in working order."""
        there = {path.stem.rstrip("_") for path in VERBS.glob("*.py") if path.stem[0] != "_"}
        ordered = [verb for _, verbs in TASKS for verb in verbs if verb in there]
        return ordered + sorted(there - set(ordered))

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one verb."""
        if cmd_name not in self.list_commands(ctx):
            return None
        command: click.Command = import_module(f"app.verbs.{file_of(cmd_name).stem}").command
        command.name = cmd_name
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the verb; one that does not exist is answered with what may have been meant."""
        verbs = self.list_commands(ctx)
        if args and args[0] not in verbs and not args[0].startswith("-"):
            near = get_close_matches(args[0], verbs)
            hint = f"Did you mean {' or '.join(near)}?" if near else "pkmcal --help lists them."
            raise click.UsageError(f'There is no verb "{args[0]}". {hint}', ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the verbs by task, without importing any of them."""
        left = self.list_commands(ctx)
        for task, verbs in (*TASKS, ("Other", tuple(left))):
            here = [verb for verb in verbs if verb in left]
            left = [verb for verb in left if verb not in here]
            if here:
                with formatter.section(task):
                    formatter.write_dl([(verb, _says(verb)) for verb in here], col_max=16)


def file_of(verb: str) -> Path:
    """The file of a verb; one that is a word of Python's has an underscore behind it."""
    path = VERBS / f"{verb}.py"
    return path if path.is_file() else VERBS / f"{verb}_.py"


def _says(verb: str) -> str:
    """First line of a verb's docstring, read without importing it."""
    with file_of(verb).open(encoding="utf-8") as source:
        return source.readline().strip().strip('"').rstrip(".")


def _manual(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    """Print the manual page and end."""
    if wanted and isinstance(context.command, click.Group):
        pages: Any = import_module("app.manual")
        click.echo(pages.manual(context.command), nl=False)
        context.exit()


def _version(context: click.Context, option: click.Parameter, wanted: bool) -> None:
    """Print the version, and by what kinematics are computed, and end."""
    if wanted:
        version = import_module("importlib.metadata").version("pkmcal")
        kernel: Any = import_module("calib.mechanism.kernel")
        by = f"the compiled core, for {kernel.processor()}"
        if not kernel.available():
            off = os.environ.get("PKMCAL_COMPILED") == "off"
            why = "PKMCAL_COMPILED=off" if off else "the core was not built here (docs/speed.md)"
            by = f"numpy, slower: {why}"
        click.echo(f"pkmcal, version {version}\nkinematics by {by}")
        context.exit()


@click.command(
    cls=Verbs,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_version,
    help="Show the version, and by what kinematics are computed, and exit.",
)  # fmt: skip
@click.option(
    "--man", is_flag=True, is_eager=True, expose_value=False, callback=_manual,
    help="Print the manual page, for man(1), and exit.",
)  # fmt: skip
@click.option("--site", type=click.Path(path_type=Path), help="Open the screens with this site.")
@click.option(
    "--folder",
    type=click.Path(path_type=Path),
    default="sessions",
    help="Where the screens keep sessions.  [default: sessions]",
)
@click.pass_context
def pkmcal(context: click.Context, site: Path | None, folder: Path) -> None:
    """Calibrate parallel-kinematic machines: measure, identify, correct, verify.

    Without a verb, the screens open.

    Exit codes: 0 answered, 2 bad input or usage, 3 hardware fault, 4 stopped by the operator,
    5 refused by a safety gate.
    """
    if context.invoked_subcommand is None:
        if not (sys.stdin.isatty() and sys.stderr.isatty()):
            raise BadInput(
                "the screens need a terminal, and there is none",
                remedy="Use the verbs: pkmcal --help lists them",
            )
        try:
            screens: Any = import_module("app.tui")
            run = screens.run
        except (ModuleNotFoundError, AttributeError):
            raise BadInput(
                "the screens are not part of this installation",
                remedy="Use the verbs: pkmcal --help lists them",
            ) from None
        run(site, root=folder)
    elif site is not None:
        raise click.UsageError("--site before a verb is for the screens; write it after the verb")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and end the process with the exit code of how the job ended."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a code page without a sign ends no answer
            if stream.isatty():
                setattr(sys, name, Lasting(stream))
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run the command line; everything foreseen becomes a message and an exit code."""
    try:
        code = pkmcal.main(args=arguments, prog_name="pkmcal", standalone_mode=False)
    except click.exceptions.Exit as done:
        return done.exit_code
    except click.ClickException as wrong:
        wrong.show()
        return EXIT_BAD_INPUT
    except BadInput as wrong:
        return _end(wrong, EXIT_BAD_INPUT)
    except DeviceError as fault:
        return _end(fault, EXIT_DEVICE)
    except StoppedByOperator as stopped:
        return _end(stopped, EXIT_STOPPED)
    except (click.Abort, KeyboardInterrupt):
        return _end(StoppedByOperator(), EXIT_STOPPED)
    except GateRefused as refused:
        return _end(refused, EXIT_REFUSED)
    except OSError as wrong:
        if wrong.filename is None:
            raise
        return _end(
            BadInput(
                wrong.strerror or str(wrong),
                place=str(wrong.filename),
                remedy="Name a place that can be read and written",
            ),
            EXIT_BAD_INPUT,
        )
    except MemoryError as wrong:
        return _end(
            BadInput(
                f"this computer has too little memory for it ({wrong or 'no size is said'})",
                remedy="Ask for less at once: fewer poses, readings or candidates",
            ),
            EXIT_BAD_INPUT,
        )
    return code if isinstance(code, int) else 0


def _end(error: Exception, code: int) -> int:
    """Say why the program ends."""
    words = {2: "bad input", 3: "hardware fault", 4: "stopped", 5: "refused"}[code]
    text = printable(str(error))
    click.echo(f"pkmcal: {words}: {text}" if text else f"pkmcal: {words}", err=True)
    return code
