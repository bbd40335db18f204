"""Write the corrected parameters in a controller's own words

For a controller that nobody here speaks to: its lines, from a template. See docs/export.md.
"""

from pathlib import Path

import click

from app import answer
from app.defaults import PLAIN, TEMPLATES
from app.surely import write_surely
from calib.errors import BadInput


@click.command()
@click.argument("model", type=click.Path(path_type=Path))
@click.option(
    "--as",
    "form",
    required=True,
    metavar="FORM",
    help=f"{', '.join((*PLAIN, *TEMPLATES))}, or a template of one's own (FILE.j2).",
)
@click.option("--machine", help="Machine file, where it is not the one that MODEL names.")
@click.option("--out", type=answer.WrittenFile(), help="Write it here.")
@click.option("--force", is_flag=True, help="Overwrite the file.")
def command(model: Path, form: str, machine: str | None, out: Path | None, force: bool) -> None:
    """Write what a controller should hold by MODEL: parameters and the machine's effects.

    Nothing is sent. A template is sandboxed, and what it names without its being there is a fault
    with its line.
    """
    from app.jobs.exporting import export

    text = export(model, form, machine=machine)
    if out is None:
        click.echo(text, nl=False)
        return
    if out.exists() and not force:
        raise BadInput("there is such a file already", place=str(out), remedy="Add --force.")
    write_surely(out, text)
    answer.say(f"written to {out}")
