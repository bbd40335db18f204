"""Start a mock machine and its tracker, to practise on"""

import argparse

import click

USAGE = 2
"""Exit code of a command line that says too little."""
WIDTH = 100
ABOUT = (
    "Run a station of mock devices and print its addresses.",
    "One machine, its controller and a tracker, each on a real wire: a process that runs until "
    "Ctrl-C. With --json the addresses are one line of JSON on standard output, the content of a "
    "site file among them; --site writes that file.",
    "do: what a person does at a station that runs, SITE being the site file that it wrote: "
    "carry an SMR, break the beam, stall a leg, cut the power, load the platform, warm it. "
    "pkmcal mock do site.toml payload kg=10; docs/mocks.md lists the commands.",
)


@click.command(context_settings={"ignore_unknown_options": True, "help_option_names": []})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(arguments: tuple[str, ...]) -> None:
    """Run a station of mock devices and print its addresses.

    All arguments go to the station: pkmcal mock hexapod --seed 7 --json. Ends on Ctrl-C. What a
    person does at a station that runs: pkmcal mock do site.toml payload kg=10.
    """
    if arguments[:1] == ("do",) and not {"-h", "--help"} & set(arguments):
        from mocks.hands import main as tell

        raise click.exceptions.Exit(tell(list(arguments[1:])))
    if not arguments or {"-h", "--help"} & set(arguments):
        from mocks.arguments import parser

        click.echo(_help(parser()), err=not arguments)
        raise click.exceptions.Exit(0 if arguments else USAGE)
    from mocks.station import main as run

    raise click.exceptions.Exit(run(list(arguments)))


def _help(station: argparse.ArgumentParser) -> str:
    """The station's options as all verbs show theirs."""
    said = click.HelpFormatter(width=WIDTH)
    said.write_usage("pkmcal mock", "[OPTIONS] MACHINE")
    said.write_usage("pkmcal mock do", "SITE COMMAND [NAME=VALUE]...", prefix="       ")
    with said.indentation():
        for paragraph in ABOUT:
            said.write_paragraph()
            said.write_text(paragraph)
    with said.section("Options"):
        said.write_dl([(_form(one), one.help or "") for one in station._actions])
    return said.getvalue().rstrip()


def _form(one: argparse.Action) -> str:
    """How an option is written."""
    names = ", ".join(one.option_strings) or str(one.metavar)
    if one.nargs == 0 or not one.option_strings:
        return names
    if one.choices:
        return f"{names} [{'|'.join(map(str, one.choices))}]"
    kinds = {int: "INTEGER", float: "FLOAT"}
    return f"{names} {one.metavar or kinds.get(one.type, 'FILE')}"  # type: ignore[call-overload]
