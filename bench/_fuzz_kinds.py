"""Every kind of file that people give to the program: a whole one, and the verb that reads it.

A verb goes as far as its first analysis: a run is fitted, a model predicts, a machine is solved.
"""

import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

import pkmcal
from app.files.machines import load_machine
from bench.no_tracker import laboratory, probed
from calib.mechanism.solve import forward
from mocks.simulate.kinds import Laboratory


@dataclass(frozen=True)
class Kind:
    """A kind of file: its name among ``files`` of a folder, and the command that reads it there."""

    name: str
    file: str
    command: tuple[str, ...]
    free: str = ""
    """What may hold any number, as a pattern of what was done."""

    @property
    def form(self) -> str:
        """What it is made of: csv, toml, ..."""
        return self.file.rpartition(".")[2]

    def is_free(self, did: str) -> bool:
        """Whether any value may stand there."""
        return bool(self.free) and re.search(self.free, did) is not None


CORRECT = ("correct", "model.toml", "--poses", "wanted.csv", "--extrapolate", "--json")
QUALITY = r"RAW:nan|^nominal|^(chi2|rms|noise|holdout|platform|left_out|readings)"
"""What a model file says for people, and that a number is not known."""
KINDS = (
    Kind("run.toml", "run/run.toml", ("fit", "run", "--json")),
    Kind("points.csv", "run/points.csv", ("fit", "run", "--json"), "cell 1[6-8] is (nan|-?inf)"),
    Kind("run.toml of version 2", "run2/run.toml", ("fit", "run2", "--json")),
    Kind("points.csv of version 2", "run2/points.csv", ("fit", "run2", "--json")),
    Kind("machine, checked", "delta.toml", ("machine", "check", "delta.toml", "--json")),
    Kind(
        "machine, solved", "mount.toml",
        ("kinematics", "mount.toml", "--forward", "mount.csv", "--json"),
    ),
    Kind("site", "site.toml", ("site", "check", "site.toml"), r"^(settle|frame_radius)"),
    Kind("site of drives", "drives.toml", ("site", "check", "drives.toml")),
    Kind("poses", "poses.toml", ("simulate", "tripod", "--poses", "poses.toml", "--out", "new")),
    Kind("poses as a table", "p.csv", ("simulate", "tripod", "--poses", "p.csv", "--out", "new")),
    Kind("model, predicting", "model.toml", ("predict", "model.toml", "run", "--json"), QUALITY),
    Kind("model, exported", "model.toml", ("export", "model.toml", "--as", "json"), QUALITY),
    Kind("model, correcting", "model.toml", CORRECT, QUALITY),
    Kind("wanted poses", "wanted.csv", CORRECT),
    Kind("actuators", "q.csv", ("kinematics", "delta", "--forward", "q.csv", "--json")),
    Kind("effect", "own.toml", ("fit", "run", "--add", "own.toml", "--json")),
    Kind("template", "own.j2", ("export", "model.toml", "--as", "own.j2"), free=".*"),
    Kind(
        "import map", "map.toml",
        ("import", "table.csv", "--map", "map.toml", "--header", "run/run.toml", "--out", "new"),
    ),
    Kind(
        "foreign table", "table.csv",
        ("import", "table.csv", "--map", "map.toml", "--header", "run/run.toml", "--out", "new"),
        "cell 1[0-9] ",  # no column that the map names
    ),
    Kind("URDF", "arm.urdf", ("machine", "import", "arm.urdf", "--out", "new.toml")),
    Kind(
        "hidden effects", "hidden.toml",
        ("simulate", "tripod", "--hidden", "hidden.toml", "--poses", "4", "--out", "new"),
    ),
)  # fmt: skip
"""The kinds, by the names that the page gives them."""

OWN = """[effect]
id = "screw-quadratic"
says = "the screw's pitch changes along its length"
acts_on = "actuator"
expression = "k * s**2 + a * sin(2 * pi * s / period)"
unknowns = { k = "1/mm", a = "mm", period = { unit = "mm", from = 2, to = 8, steps = 5 } }
"""
MAP = """format = "pkm-import/1"
[file]
delimiter = ","
[time]
column = "time_s"
form = "s"
unit = "s"
[pose]
column = "pose"
[nest]
column = "nest"
[actuators]
columns = "q*"
unit = "mm"
[[reading]]
columns = ["x", "y", "z"]
unit = "mm"
[sigma]
value = "5 um"
"""
POSES = """format = "pkm-poses/1"
machine = "tripod"
title = "two poses"
[poses]
a = {{ x = 1.0, y = -2.0, z = {z} }}
b = {{ x = "0.1 mm", y = 3.0, z = {z}, q = [0.0, 0.0, 0.0] }}
"""
LINES = """[tracker]
kind = "lines"
link = "tcp"
source = "127.0.0.1:9"
unit = "mm"
sigma_mm = 0.01
frame = [-900.0, -900.0, -400.0, 0.0, 0.0, 0.3]
"""
HIDDEN = """[hidden]
"backlash.limb1" = 0.01
"nest-offset.p1.x" = 0.02
"""
TEMPLATE = """{% for p in parameters %}{{ p.name }} = {{ p.value | round(4) }} {{ p.unit }}
{% endfor %}"""
TABLE = "pose,x,y,z\n1,1.0,-2.0,{z}\n2,0.0,3.0,{z}\n"
SIX = "pose,x,y,z,rx,ry,rz\n1,1.0,-2.0,{z},0.0,0.0,0.0\n2,0.0,3.0,{z},0.0,0.0,0.0\n"
URDF_JOINT = """<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{j}"/>
<child link="l{k}"/><origin xyz="0.1 0.05 0.3" rpy="{turn} 0.0 0.2"/><axis xyz="0 0 1"/>
<limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
"""


def corpus(folder: Path) -> Path:
    """Write a whole file of every kind; nothing in it is wrong."""
    folder.mkdir(parents=True, exist_ok=True)
    pkmcal.simulate("tripod", folder / "run", poses=9, seed=3, rise=1.0, order="pose-by-pose")
    _version_2(folder / "run2")
    pkmcal.fit(folder / "run").save(folder / "model.toml")
    data = Path(__file__).parents[1] / "tests" / "data" / "maps"
    tripod = load_machine("tripod")
    height = float(forward(tripod, np.zeros((3, 1)), tripod.nominal).poses.position[2, 0]) + 20.0
    arm = "".join(
        URDF_JOINT.format(j=k, k=k + 1, turn=(0.0, 1.5707963, -1.5707963)[k % 3]) for k in range(6)
    )
    texts = {
        "delta.toml": files("calib.machines").joinpath("delta.toml").read_text("utf-8"),
        "mount.toml": (data / "mount.toml").read_text("utf-8"),
        "mount.csv": "pose,az [deg],el [deg]\n1,10.0,45.0\n2,-30.0,50.0\n",
        "site.toml": _example("site-file.md"),
        "drives.toml": _of_lines(_example("site-file.md", 'kind = "drives"')),
        "poses.toml": POSES.format(z=height).replace(", q = [0.0, 0.0, 0.0]", ""),
        "p.csv": SIX.format(z=height),
        "wanted.csv": TABLE.format(z=height),
        "q.csv": "q1,q2,q3\n380.0,380.0,380.0\n370.0,385.5,391.0\n",
        "own.toml": OWN,
        "own.j2": TEMPLATE,
        "map.toml": MAP,
        "table.csv": (folder / "run" / "points.csv").read_text("utf-8"),
        "arm.urdf": f'<robot name="arm"><link name="l0"/>{arm}</robot>\n',
        "hidden.toml": HIDDEN,
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def _example(page: str, has: str = "") -> str:
    """The first example of TOML on a page that has some words."""
    text = (Path(__file__).parents[1] / "docs" / page).read_text(encoding="utf-8")
    return next(one for one in re.findall(r"```toml\n(.*?)```", text, re.DOTALL) if has in one)


def _of_lines(site: str) -> str:
    """The same site with an instrument that sends lines."""
    before, _, after = site.partition("[tracker]")
    return f"{before}{LINES}\n[nests.platform]{after.partition('[nests.platform]')[2]}"


def _version_2(folder: Path) -> None:
    """A run of version 2: points of a tracker, heights of a probe, lengths between marks, tilts."""
    machine = load_machine("delta")
    rng = np.random.default_rng(5)
    q = probed(machine)[:, ::4]
    poses = forward(machine, machine.extension(q), machine.nominal).poses
    lab: Laboratory = laboratory(machine, machine.nominal, q, rng)
    for k in range(q.shape[1]):
        lab.go(f"{k}", q[:, k].tolist(), poses.position[:, k], poses.rotation[:, :, k])
        lab.point("tool", 0.01, by="tracker")
        lab.point("tool", 0.01, by="probe", only="z")
        lab.angles("tool", 1e-5, by="tracker")
    lab.marks("tool", "0", "3", 0.02, by="calipers")
    for nest in lab.base:
        lab.point(nest, 0.01, by="tracker")
    folder.mkdir()
    for name, text in zip(("run.toml", "points.csv"), lab.texts(), strict=True):
        (folder / name).write_text(text, encoding="utf-8")
