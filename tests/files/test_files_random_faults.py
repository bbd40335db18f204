"""Whatever somebody does to a file: it is read, or refused in words with the place of the fault."""

from functools import cache
from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.files.fits import parse_fit
from app.files.machines import load_machine
from app.files.poses import parse_pose_file
from app.files.site import parse_site
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.formulas.expression import parse_expression
from calib.mechanism.parse import parse_machine
from calib.runs import parse_run

RUNS = Path(__file__).parents[1] / "data" / "runs"
HERE = Path(__file__).parent
NASTY = (
    "", "0", "-1", "1e999", "nan", "inf", "-inf", "true", '"', "'", "[", "]", "{", "}", "=", ",",
    ":", "(", ")", "\n", "\t", "\x00", "é", "𝔘", "1.5.2", "q1", "12 deg", "0x10", "[[a]]", "**",
    "1e-400", "9" * 400, '"""', "#", ";", "-", "pkm-run/2", "limb9", "Rx", "::", "../..",
)  # fmt: skip


@cache
def machine():
    return load_machine("hexapod")


RUN_TOML = (RUNS / "no-effect" / "run.toml").read_text(encoding="utf-8")
POINTS = "\n".join((RUNS / "no-effect" / "points.csv").read_text("utf-8").splitlines()[:12]) + "\n"
MACHINE = files("calib.machines").joinpath("delta.toml").read_text(encoding="utf-8")
EFFECT = """[effect]
id = "screw-quadratic"
says = "the screw's pitch changes along its length"
acts_on = "actuator"
expression = "k * s**2 + a * sin(2 * pi * s / period)"
unknowns = { k = "1/mm", a = "mm", period = { unit = "mm", from = 2, to = 8 } }
"""
SITE = """format = "pkm-site/1"
machine = "hexapod"
[controller]
kind = "canopen"
interface = "slcan"
channel = "socket://127.0.0.1:9"
[tracker]
kind = "emscon"
address = "127.0.0.1:9"
frame = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
[nests.platform]
"3" = [0.0, 100.0, 0.0]
[nests.base]
b1 = [240.0, 415.0, -40.0]
b2 = [-480.0, 0.0, -40.0]
b3 = [0.0, -480.0, -40.0]
"""
POSE_FILE = """format = "pkm-poses/1"
machine = "hexapod"
[poses]
a = { x = 0.0, y = 0.0, z = 220.0, rx = 0.0, ry = 0.0, rz = 0.0 }
b = { x = 5.0, y = 0.0, z = 221.0, rx = "2 deg", ry = 0.0, rz = 0.0 }
"""
FIT = """format = "pkm-model/1"
machine = "hexapod"
effects = ["backlash"]
[[parameters]]
name = "leg1.L0"
value = 230.7
sigma = 0.01
unit = "mm"
nominal = 230.7
identified = true
"""
FORMULA = "k * s**2 + 0.5 * sin(2 * pi * q / 4) * sign(direction) - t / (1 + abs(x))"

READERS = {
    "run.toml": (RUN_TOML, lambda text: parse_run(text, POINTS, actuators=6)),
    "points.csv": (POINTS, lambda text: parse_run(RUN_TOML, text, actuators=6)),
    "machine": (MACHINE, lambda text: parse_machine(text, "m.toml")),
    "effect": (EFFECT, lambda text: effect_from_text(text, "e.toml")),
    "site": (SITE, lambda text: parse_site(text, "site.toml", HERE)),
    "poses": (POSE_FILE, lambda text: parse_pose_file(text, "poses.toml", machine())),
    "model": (FIT, lambda text: parse_fit(text, "model.toml")),
    "formula": (FORMULA, lambda text: parse_expression(text, "formula")),
}


@st.composite
def spoilt(draw, text):
    """A text with one to three things done to it."""
    for _ in range(draw(st.integers(1, 3))):
        first = draw(st.integers(0, len(text)))
        last = min(first + draw(st.integers(0, 30)), len(text))
        what = draw(st.sampled_from(["cut", "end", "put", "twice", "lines", "token"]))
        if what == "cut":
            text = text[:first] + text[last:]
        elif what == "end":
            text = text[:first]
        elif what == "put":
            text = text[:first] + draw(st.sampled_from(NASTY)) + text[first:]
        elif what == "twice":
            text = text[:last] + text[first:]
        elif what == "lines":
            lines = text.split("\n")
            one, two = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
            lines[one], lines[two] = lines[two], lines[one]
            text = "\n".join(lines)
        else:
            words = text.split(" ")
            words[draw(st.integers(0, len(words) - 1))] = draw(st.sampled_from(NASTY))
            text = " ".join(words)
    return text


def refusal(read, text):
    """Where the fault is, where the text is refused; None where it is read."""
    try:
        read(text)
    except BadInput as refused:
        return refused.place
    return None


@pytest.mark.parametrize("kind", READERS)
def test_files_as_they_are_are_read(kind):
    text, read = READERS[kind]
    read(text)


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=80, deadline=None, derandomize=True)
@given(data=st.data())
def test_files_that_somebody_has_spoilt_are_read_or_refused_with_a_place(kind, data):
    text, read = READERS[kind]
    assert refusal(read, data.draw(spoilt(text))) != ""


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.text(st.sampled_from("ksqlt0123456789.+-*/() ,e_xyz[]^%piasn\n\"'"), max_size=40))
def test_files_formula_of_any_characters_is_read_or_refused_with_a_place(text):
    assert refusal(lambda text: parse_expression(text, "formula"), text) != ""
