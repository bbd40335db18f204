"""Law: what the writer writes, the reader reads as the same run, whatever is in it."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.files.runs import read_run, write_run
from calib.errors import BadInput
from calib.runs import Digits, Header, Load, Run, format_run, parse_run

RUNS = Path(__file__).parents[1] / "data" / "runs"
NUMBER = st.floats(-1e6, 1e6, allow_subnormal=False)
SIGMA = st.floats(1e-6, 10.0)
CORRELATION = st.floats(-0.4, 0.4)
# A field is read without the blanks around it, and the ends of lines are those of the rows.
NAME = st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\r\n"), max_size=8
).filter(lambda text: text == text.strip())
COLUMNS = {"time_s", "pose", "nest", "x", "y", "z", "sx", "sy", "sz", "sxy", "sxz", "syz"}


@st.composite
def vectors(draw):
    return np.array([draw(NUMBER) for _ in range(3)])


@st.composite
def headers(draw):
    names = draw(st.lists(NAME.filter(bool), min_size=2, max_size=5, unique=True))
    cut = draw(st.integers(1, len(names)))
    load = st.builds(Load, vectors(), st.floats(0.0, 1e3), vectors(), vectors())
    values = st.dictionaries(NAME.filter(bool), NUMBER, max_size=3)
    return Header(
        machine=draw(NAME.filter(bool)),
        title=draw(st.text(st.characters(exclude_categories=["Cs"]))),
        tracker=draw(st.dictionaries(NAME, st.one_of(NAME, NUMBER, st.booleans()), max_size=2)),
        platform_nests={name: draw(vectors()) for name in names[:cut]},
        base_nests={name: draw(vectors()) for name in names[cut:]},
        controller_serial=draw(NAME),
        controller_parameters=draw(values),
        compensation=draw(values),
        controller_frame=draw(st.dictionaries(NAME.filter(bool), NAME, max_size=2)),
        load=draw(st.none() | load),
    )


@st.composite
def readings(draw, nest):
    """Position and covariance of a row; nan where nothing was read."""
    if not nest:
        return np.full(3, np.nan), np.full((3, 3), np.nan)
    sigma = np.array([draw(SIGMA) for _ in range(3)])
    correlation = np.eye(3)
    if draw(st.booleans()):
        for i, j in ((0, 1), (0, 2), (1, 2)):
            correlation[i, j] = correlation[j, i] = draw(CORRELATION)
    covariance = correlation * (sigma[:, None] * sigma)
    covariance[range(3), range(3)] = sigma**2
    return draw(vectors()), covariance


@st.composite
def channels(draw, count):
    name = NAME.filter(lambda text: text and text not in COLUMNS and not text.startswith("q"))
    value = st.one_of(NUMBER, st.just(np.nan))
    column = st.lists(value, min_size=count, max_size=count).map(np.array)
    found = draw(st.dictionaries(name, column, max_size=3))
    return {k: np.abs(v) if k == "delay_s" else v for k, v in found.items()}


@st.composite
def runs(draw):
    header, actuators = draw(headers()), draw(st.integers(1, 4))
    known = [*header.platform_nests, *header.base_nests]
    nest = draw(st.lists(st.sampled_from(["", *known]), min_size=1, max_size=6).filter(any))
    rows = [draw(readings(name)) for name in nest]
    return Run(
        header=header,
        source="points.csv",
        line=np.arange(len(nest)) + 2,
        time_s=np.sort([draw(NUMBER) for _ in nest]),
        pose=tuple(draw(NAME) for _ in nest),
        nest=tuple(nest),
        q=np.array([[draw(NUMBER) for _ in nest] for _ in range(actuators)]),
        measured=np.array([bool(name) for name in nest]),
        position=np.array([position for position, _ in rows]).T,
        covariance=np.array([covariance for _, covariance in rows]).transpose(1, 2, 0),
        channels=draw(channels(len(nest))),
        left_aside={},
    )


def assert_same(first, second, skip=()):
    """Every field of two records is the same, bit for bit."""
    for field in dataclasses.fields(first):
        one, other = getattr(first, field.name), getattr(second, field.name)
        if field.name in skip:
            continue
        if dataclasses.is_dataclass(one):
            assert_same(one, other)
        elif isinstance(one, dict):
            assert list(one) == list(other)
            for key in one:
                np.testing.assert_array_equal(one[key], other[key])
        else:
            np.testing.assert_array_equal(one, other)


@pytest.mark.long
@given(runs())
@settings(max_examples=80, deadline=None, derandomize=True)
def test_a_run_written_is_read_as_the_same_run(run):
    again = parse_run(*format_run(run), actuators=run.q.shape[0])
    assert_same(run, again)
    assert format_run(again) == format_run(run)


@given(runs(), st.integers(0, 6))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_fewer_digits_are_the_same_run_to_those_digits(run, places):
    spec = f".{places}f"
    written = format_run(run, Digits(time=spec, q=spec, position=spec, channel=spec))
    again = parse_run(*written, actuators=run.q.shape[0])
    within = 0.50001 * 10.0**-places + 1e-9
    np.testing.assert_allclose(again.q, run.q, rtol=0, atol=within)
    np.testing.assert_allclose(again.position, run.position, rtol=0, atol=within)
    assert list(again.channels) == list(run.channels)


@pytest.mark.long
@given(runs())
@settings(max_examples=20, deadline=None, derandomize=True)
def test_line_ends_and_byte_order_marks_change_nothing(run):
    texts = format_run(run)
    other = ["\ufeff" + text.replace("\n", "\r\n") for text in texts]
    assert_same(run, parse_run(*other, actuators=run.q.shape[0]))


def test_a_folder_that_holds_a_run_is_not_written_over_unless_it_is_said(tmp_path):
    loaded = read_run(RUNS / "no-effect")
    write_run(tmp_path / "copy", loaded.run)
    assert_same(loaded.run, read_run(tmp_path / "copy").run, skip=("source",))
    with pytest.raises(BadInput, match="exists already"):
        write_run(tmp_path / "copy", loaded.run)
    write_run(tmp_path / "copy", loaded.run, replace=True)
    assert sorted(path.name for path in (tmp_path / "copy").iterdir()) == ["points.csv", "run.toml"]
