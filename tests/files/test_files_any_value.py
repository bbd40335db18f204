"""Law: whatever stands under a key, a reader answers or names the fault; it never breaks down."""

import contextlib
import tomllib
from importlib.resources import files
from pathlib import Path

import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from app.files.fits import parse_fit
from app.files.machines import load_machine
from app.files.poses import parse_pose_file
from app.files.site import parse_site
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.mechanism.parse import parse_machine
from calib.runs import parse_header

DOCS = Path(__file__).parents[2] / "docs"
HEXAPOD = load_machine("hexapod")
LEAF = st.one_of(
    st.integers(),
    st.just(10**400),
    st.floats(allow_nan=True, allow_infinity=True),
    st.booleans(),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=6),
    st.sampled_from(["12 deg", "1 mm", "leg1.L0", "q1", "", "tx:1 Rx", "10 mm/turn", "a.b"]),
    st.dates(),
)
VALUE = st.recursive(
    LEAF,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=2)
    ),
    max_leaves=4,
)


def example(page: str) -> str:
    text = (DOCS / page).read_text(encoding="utf-8")
    return text.split("```toml\n")[1].split("```")[0]


def machine(name: str) -> str:
    return files("calib.machines").joinpath(f"{name}.toml").read_text(encoding="utf-8")


READERS = {
    "run": (example("run-format.md"), lambda text: parse_header(text)),
    "model": (example("model-file.md"), lambda text: parse_fit(text, "x.toml")),
    "poses": (example("poses-file.md"), lambda text: parse_pose_file(text, "x.toml", HEXAPOD)),
    "site": (example("site-file.md"), lambda text: parse_site(text, "x.toml", Path())),
    "effect": (example("own-effects.md"), lambda text: effect_from_text(text, "x.toml")),
    "hexapod": (machine("hexapod"), lambda text: parse_machine(text, "x.toml")),
    "delta": (machine("delta"), lambda text: parse_machine(text, "x.toml")),
}


def places(node: object) -> list[tuple[object, object]]:
    """Every (container, key) of a tree."""
    inside = node.items() if isinstance(node, dict) else enumerate(node)
    found = []
    for key, value in inside:
        found.append((node, key))
        if isinstance(value, dict | list):
            found += places(value)
    return found


@pytest.mark.long
@pytest.mark.parametrize("name", READERS)
def test_any_value_under_any_key_is_read_or_named(name: str) -> None:
    text, read = READERS[name]
    count = len(places(tomllib.loads(text)))

    @given(st.integers(0, count - 1), VALUE, st.sampled_from(["replace", "remove", "add"]))
    @settings(max_examples=40, deadline=None, derandomize=True)
    def changed(place: int, value: object, how: str) -> None:
        data = tomllib.loads(text)
        container, key = places(data)[place]
        if how == "remove":
            del container[key]
        elif how == "add" and isinstance(container, dict):
            container["more"] = value
        else:
            container[key] = value
        with contextlib.suppress(BadInput):
            read(tomli_w.dumps(data))

    changed()
