"""The manual page, pkmcal(1), made from what the command line says of itself."""

import contextlib
import inspect
import io
from collections.abc import Iterator
from importlib.metadata import version

import click

from app.tasks import TASKS

FILES = (
    ("sessions/", "where sessions, the history of the machines and what verifications kept lie"),
    ("$PKMCAL_STATE", "parameter sets and locks of controllers; by default in the user's folder"),
)
EXITS = (
    ("0", "answered, whatever the answer"), ("2", "bad input or usage"), ("3", "hardware fault"),
    ("4", "stopped by the operator"), ("5", "refused by a safety gate"),
)  # fmt: skip


def manual(program: click.Group) -> str:
    """The page in the language of man(7)."""
    with click.Context(program, info_name="pkmcal") as context:
        lines = [
            f'.TH PKMCAL 1 "" "pkmcal {version("pkmcal")}" "User Commands"',
            ".SH NAME", "pkmcal \\- calibrate parallel-kinematic machines",
            ".SH SYNOPSIS", ".B pkmcal", "[OPTIONS] [VERB] ...",
            ".SH DESCRIPTION", *_paragraphs(program.help or ""),
            ".SH OPTIONS", *_options(program, context),
        ]  # fmt: skip
        for task, verbs in TASKS:
            lines.append(f".SH {_safe(task).upper()}")
            for verb in verbs:
                lines += _verb(program, verb, context)
    lines += [".SH EXIT STATUS", *_list(EXITS), ".SH FILES", *_list(FILES)]
    return "\n".join(lines) + "\n"


def _verb(program: click.Group, name: str, context: click.Context) -> Iterator[str]:
    command = program.get_command(context, name)
    if command is None:
        return
    if command.context_settings.get("help_option_names") == []:
        yield from _own_help(command, name)
        return
    yield from _command(command, click.Context(command, info_name=name, parent=context))


def _own_help(command: click.Command, name: str) -> Iterator[str]:
    """A verb that shows a help of its own: that, line by line."""
    yield f".SS pkmcal {_safe(name)}"
    yield ".nf"
    text = io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.suppress(click.exceptions.Exit):
        command.main(["--help"], prog_name=f"pkmcal {name}", standalone_mode=False)
    yield from (_safe(line) for line in text.getvalue().splitlines())
    yield ".fi"


def _command(command: click.Command, context: click.Context) -> Iterator[str]:
    """A verb; those below it follow, each with its own heading."""
    pieces = " ".join(command.collect_usage_pieces(context))
    yield f".SS {_safe(f'{context.command_path} {pieces}'.strip())}"
    yield from _paragraphs(command.help or "")
    yield from _options(command, context)
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None:
                yield from _command(below, click.Context(below, info_name=name, parent=context))


def _options(command: click.Command, context: click.Context) -> Iterator[str]:
    records = (one.get_help_record(context) for one in command.get_params(context))
    yield from _list(record for record in records if record is not None and record[1])


def _list(entries: "Iterator[tuple[str, str]] | tuple[tuple[str, str], ...]") -> Iterator[str]:
    for form, says in entries:
        yield ".TP"
        yield f".B {_safe(form)}"
        yield _safe(says) or "\\&"


def _paragraphs(text: str) -> Iterator[str]:
    """Paragraphs of a docstring; one that begins with \\b stands as it is written."""
    for paragraph in inspect.cleandoc(text).split("\n\n"):
        kept = paragraph.startswith("\b")
        yield from (".PP", ".nf") if kept else (".PP",)
        yield from (_safe(line) for line in paragraph.lstrip("\b\n").splitlines())
        if kept:
            yield ".fi"


def _safe(text: str) -> str:
    """Nothing in it is a request or a hyphen that could be broken or changed."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join(f"\\&{line}" if line[:1] in (".", "'") else line for line in text.split("\n"))
