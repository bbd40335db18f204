"""Start a mock machine and its tracker, to practise on"""

import click


@click.command(context_settings={"ignore_unknown_options": True, "help_option_names": []})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(arguments: tuple[str, ...]) -> None:
    """Run a station of mock devices and print its addresses.

    All arguments go to the station: pkmcal mock hexapod --seed 7 --json. Ends on Ctrl-C. What a
    person does at a station that runs: pkmcal mock do site.toml payload kg=10.
    """
    # Imported here: whoever talks to a station needs none.
    if arguments[:1] == ("do",):
        from mocks.hands import main as tell

        raise click.exceptions.Exit(tell(list(arguments[1:])))
    from mocks.station import main as run

    raise click.exceptions.Exit(run(list(arguments)))
