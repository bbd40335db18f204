"""Closed loops beside a URDF, which is a tree: what is driven, where it is cut, where home is.

Two forms of the same. A list in TOML (lengths m, angles rad, as in the URDF)::

    platform = "plate"                       # the link whose pose is commanded
    actuated = ["slide1", "slide2"]          # joints with a drive; all others are passive
    coordinates = ["x", "y", "z"]            # what is commanded; all six without
    home = { slide1 = 0.37, hook1 = 0.45 }   # joint values at which the loops close; 0 without
    [[loop]]
    from = "rod2"                            # the last link of a limb in the tree,
    xyz = [0, 0, -0.3]                       # where the closing joint is in it,
    to = "plate"                             # the link that it holds on to,
    to_xyz = [0.03, 0, 0]                    # and where the joint is in that one
    joint = "ball"                           # universal (x, then y), hinge, slide (z), fixed

or elements within the URDF, as ``export --as urdf`` writes them: ``<loop type="ball">`` with
``<predecessor link=...>`` and ``<successor link=...>``, each with an ``<origin>``;
``<transmission>`` names what is driven, ``<group_state name="home">`` (of SRDF) home,
``<task coordinates="x y z"/>`` what is commanded.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from app.files.urdf import numbers_of, transform
from calib.arrays import Array
from calib.errors import BadInput
from calib.toml_table import TomlTable

CLOSING = ("ball", "universal", "hinge", "slide", "fixed")


@dataclass(frozen=True, eq=False)
class Loop:
    """A closing joint: its frame (4, 4) in the link ``first`` and in the link ``second``, m."""

    first: str
    second: str
    in_first: Array
    in_second: Array
    kind: str


@dataclass(frozen=True, eq=False)
class Loops:
    """What makes a tree a parallel machine; ``platform`` empty where nothing closes."""

    platform: str = ""
    actuated: tuple[str, ...] = ()
    coordinates: tuple[str, ...] = ()
    home: Mapping[str, float] | None = None
    loops: tuple[Loop, ...] = ()


def loops_in_toml(text: str, source: str) -> Loops:
    """Read a list of constraints; raises BadInput with its line."""
    top = TomlTable.parse(text, source)
    top.only("platform", "actuated", "coordinates", "home", "loop")
    found = []
    for table in top.tables("loop"):
        table.only("from", "xyz", "rpy", "to", "to_xyz", "to_rpy", "joint")
        frames = [
            transform(*(np.array(table.numbers(key, 3, (0.0, 0.0, 0.0))) for key in keys))
            for keys in (("xyz", "rpy"), ("to_xyz", "to_rpy"))
        ]
        kind = table.choice("joint", CLOSING)
        found.append(Loop(table.text("from"), table.text("to"), frames[0], frames[1], kind))
    if not found:
        raise top.wrong("no loop is listed", remedy="Write [[loop]] tables with from and to")
    return Loops(
        top.text("platform"),
        tuple(top.texts("actuated")),
        tuple(top.texts("coordinates")) if top.has("coordinates") else (),
        top.numbers_by_name("home"),
        tuple(found),
    )


def loops_in_urdf(root: ET.Element, source: str) -> Loops:
    """Read the elements within a URDF; of a URDF without any loop nothing but what is driven."""
    actuated = [
        joint.get("name", "") for one in root.findall("transmission") for joint in one.iter("joint")
    ]
    loops = tuple(_loop(one, source) for one in root.findall("loop"))
    home: dict[str, float] = {}
    for state in root.findall("group_state"):
        for joint in state.findall("joint") if state.get("name") == "home" else ():
            home[joint.get("name", "")] = float(numbers_of(joint.get("value", "0"), 1, source)[0])
    platforms = {one.second for one in loops}
    if len(platforms) > 1:
        raise BadInput(
            f"its loops end on {' and '.join(sorted(platforms))}",
            place=source,
            remedy="List the constraints in a file, and name the platform: --loops FILE",
        )
    task = root.find("task")
    coordinates = () if task is None else tuple(task.get("coordinates", "").split())
    platform = next(iter(platforms), "")
    return Loops(platform, tuple(dict.fromkeys(actuated)), coordinates, home, loops)


def _loop(node: ET.Element, source: str) -> Loop:
    kind = node.get("type", "")
    place = f'{source}, loop "{node.get("name", "")}"'
    if kind not in CLOSING:
        raise BadInput(
            f'it is of type "{kind}"', place=place, remedy=f"Known are {', '.join(CLOSING)}"
        )
    ends = []
    for name in ("predecessor", "successor"):
        end = node.find(name)
        if end is None or not end.get("link"):
            raise BadInput(f"it has no {name}", place=place, remedy="Name two links")
        origin = end.find("origin")
        texts = {} if origin is None else origin.attrib
        frame = transform(
            *(numbers_of(texts.get(key, "0 0 0"), 3, place) for key in ("xyz", "rpy"))
        )
        ends.append((end.get("link", ""), frame))
    (first, in_first), (second, in_second) = ends
    return Loop(first, second, in_first, in_second, kind)


def written_loops(loops: Loops) -> Iterator[str]:
    """Lines of XML for within a URDF."""
    for number, one in enumerate(loops.loops, start=1):
        yield f'  <loop name="loop{number}" type="{one.kind}">'
        yield f'    <predecessor link="{one.first}"/>'
        yield f'    <successor link="{one.second}"/>'
        yield "  </loop>"
    for name in loops.actuated:
        yield f'  <transmission name="{name}_drive"><joint name="{name}"/></transmission>'
    yield f'  <task coordinates="{" ".join(loops.coordinates)}"/>'
    if loops.home:
        yield '  <group_state name="home" group="all">'
        for name, value in loops.home.items():
            yield f'    <joint name="{name}" value="{value!r}"/>'
        yield "  </group_state>"
