"""Set every number of the three papers beside ours, with figures"""

import time
from pathlib import Path

import click


@click.command()
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("docs"),
    show_default=True,
    help="Folder for reproduction.md and its figures.",
)
@click.option(
    "--paper",
    "papers",
    multiple=True,
    type=click.Choice(["han", "feng", "zhang"]),
    help="Only this paper (may be given several times).",
)
def command(out: Path, papers: tuple[str, ...]) -> None:
    """Compute every number of the three papers and write a page that sets them beside theirs.

    Takes a few minutes. Each number is called reached, better, or not reachable with the reason.
    """
    # Imported here: matplotlib and the studies are for this verb alone.
    from app.reproduce.page import PAPERS, write_page

    begin = time.monotonic()
    for line in write_page(list(papers) or list(PAPERS), out):
        click.echo(line)
    click.echo(f"{out / 'reproduction.md'} written in {time.monotonic() - begin:.0f} s")
