"""Start a mock machine and its tracker, to practise on"""

import signal
import subprocess
import sys

import click


@click.command(context_settings={"ignore_unknown_options": True, "help_option_names": []})
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def command(arguments: tuple[str, ...]) -> None:
    """Start a station of mock devices as a process of its own and print its addresses.

    All arguments go to the station: pkmcal mock hexapod --seed 7 --json. Ends on Ctrl-C. What a
    person does at a station that runs: pkmcal mock do site.toml payload kg=10.
    """
    if arguments[:1] == ("do",):
        hands = subprocess.run([sys.executable, "-m", "mocks.hands", *arguments[1:]], check=False)
        raise click.exceptions.Exit(hands.returncode)
    station = subprocess.Popen([sys.executable, "-m", "mocks.station", *arguments])
    # Whoever ends this process means the station.
    signal.signal(signal.SIGTERM, lambda *_: station.terminate())
    try:
        code = station.wait()
    except KeyboardInterrupt:
        # The terminal sent the interrupt to the station as well: let it leave in its own way.
        code = station.wait(timeout=10.0)
    raise click.exceptions.Exit(code)
