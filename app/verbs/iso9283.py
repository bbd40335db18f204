"""Judge accuracy and repeatability by ISO 9283, from a run with cycles"""

from pathlib import Path

import click

from app import answer


@click.command()
@click.argument("run", type=click.Path(path_type=Path))
@click.option("--point", default="", help="Judge the SMR in this nest, not the platform's origin.")
@click.option("--pairs", default="", help="Pairs for the distances, P2:P4,P1:P3; else neighbours.")
@answer.json_option
def command(run: Path, point: str, pairs: str, as_json: bool) -> None:
    """Pose accuracy AP and repeatability RP, distance accuracy AD and repeatability RD.

    The run repeats the same poses in cycles (pkmcal measure --cycles 30). With three nests read at
    a pose the whole pose is judged, else the SMR's centre.
    """
    from app.jobs.repeating import iso9283

    found = iso9283(run, point=point, pairs=pairs)
    answer.show(found.to_json(), as_json, found.text)
