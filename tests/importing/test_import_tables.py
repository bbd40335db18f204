"""Tables as programs write them: read as they are laid out, or refused with line and column."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.files import patterns
from app.files.foreign_layout import Layout
from app.files.foreign_numbers import parse_number
from app.files.foreign_table import read_foreign, table_of
from calib.errors import BadInput
from calib.toml_table import TomlTable
from calib.units import UNITS, split_header, unit_named

SEMI = Layout(delimiter=";", decimal=",")


@given(
    st.floats(-1e9, 1e9),
    st.sampled_from([(".", ""), (",", ""), (".", ","), (",", "."), (",", "'")]),
)
def test_a_number_is_read_as_it_is_written(value: float, signs: tuple[str, str]) -> None:
    decimal, thousands = signs
    text = f"{value:,.6f}".replace(",", "T").replace(".", decimal).replace("T", thousands)
    layout = Layout(decimal=decimal, thousands=thousands)
    assert parse_number(text, layout) == float(f"{value:.6f}")


@pytest.mark.parametrize(
    "cell",
    ["1,234.5", "1.234,5", "1,5", "0x10", "1_000", "inf", "1e999", "12:30", "", "--1", "1 2"],
)
def test_what_is_no_number_in_these_signs_is_none(cell: str) -> None:
    assert parse_number(cell, Layout()) is None


@pytest.mark.parametrize(
    ("encoding", "raw"),
    [
        ("utf-8", "\ufeffsep=;\r\nLänge [mm];b\r\n1,5;2\r\n".encode()),
        ("latin-1", "Länge [mm];b\n1,5;2\n".encode("latin-1")),
        ("cp1252", "Länge [mm];b;;\r1,5;2;;\r".encode("cp1252")),
        ("utf-16", 'Länge [mm];"b"\r\n"1,5";2\r\n'.encode("utf-16")),
    ],
)
def test_habits_of_sheets_are_read(tmp_path: Path, encoding: str, raw: bytes) -> None:
    (tmp_path / "a.csv").write_bytes(raw)
    table = read_foreign(tmp_path / "a.csv", Layout(encoding=encoding, delimiter=";", decimal=","))
    assert (table.names, table.units, table.width) == (("Länge", "b"), ("mm", ""), 2)
    assert [table.number(0, at) for at in (0, 1)] == [1.5, 2.0]


@pytest.mark.parametrize(
    ("raw", "layout", "said"),
    [
        (b"x;y\n1,5;2\n", Layout(delimiter=";"), "line 2, column x: found '1,5'"),
        (b"x;y\n1,5;2\n", Layout(delimiter=";"), 'write decimal = ","'),
        (b'x,y\n"1,234.5",2\n', Layout(), 'decimal = "." and thousands = ","'),
        (b"x;y\n1.234,5;2\n", SEMI, 'decimal = "," and thousands = "."'),
        (b"x;y\n1;2\n", Layout(), 'line 1: the whole line of names'),
        (b"sep=;\nx;y\n1;2\n", Layout(), 'line 1: the file says that ";" stands between columns'),
        (b"x,y\n1,5,2\n", Layout(), "line 2: 3 fields found"),
        (b"x,y\n1,2\n3\n", Layout(), "line 3: 1 fields found"),
        (b'x,y\n1,"2\n', Layout(), "quotation mark"),
        (b"L\xe4nge,y\n1,2\n", Layout(), "line 1: byte 0xe4 is not UTF-8"),
        (b"x,y\n\x00,2\n", Layout(), "line 2: the file holds a zero byte"),
        (b"\xff\xfex\x00", Layout(), "the file is UTF-16"),
        (b"", Layout(), "the file is empty"),
        (b"x,y\n", Layout(), "holds no row"),
        (b"1,2\n", Layout(header=False, after="^BEGIN"), "no line as the table should"),
        (b"1,2\n", Layout(header=False, fields=3), "Expected 3, as the map says"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(tmp_path: Path, raw: bytes, layout: Layout, said: str) -> None:
    (tmp_path / "a.csv").write_bytes(raw)

    def read_all() -> None:
        table = read_foreign(tmp_path / "a.csv", layout)
        for at in range(table.width):
            table.number(0, at)

    with pytest.raises(BadInput) as wrong:
        read_all()
    assert said in str(wrong.value)


def test_lines_are_those_of_the_file_whatever_stands_between() -> None:
    layout = Layout(comments=("//",), skip=1, units_row=True, end="^END", missing=("-",))
    text = "A caption\n// remark\n\nx,y\nmm,deg\n// more\n1,-\n\n3,4\nEND\nnothing,of,it\n"
    table = table_of(text, layout, "a.txt")
    assert (table.names, table.units) == (("x", "y"), ("mm", "deg"))
    assert table.lines == (7, 9)
    assert (table.text(0, 1), table.place(1, 1)) == ("", "a.txt, line 9, column y")
    assert table.number(0, 1) != table.number(0, 1)


def test_a_column_is_named_or_counted_and_else_refused() -> None:
    table = table_of("x,x,J[1]\n1,2,3\n", Layout(), "a.csv")
    assert (table.index(2, ""), table.index("J[1]", "")) == (1, 2)
    for column, said in (
        ("x", "2 columns"),
        ("z", "There are: x, x, J[1]"),
        (4, "has 3"),
        (0, "0"),
    ):
        with pytest.raises(BadInput, match=said.replace("[", r"\[")):
            table.index(column, "map")


@pytest.mark.parametrize("name", [name for name in UNITS if name != "1"])
def test_a_unit_in_a_header_is_the_unit_by_its_name(name: str) -> None:
    assert split_header(f"a b [{name}]") == split_header(f"a b ({name})") == ("a b", name)
    assert unit_named(name, "").base == UNITS[name].base


def test_units_are_what_they_are() -> None:
    known = {
        "degF": (212.0, 100.0),
        "K": (293.15, 20.0),
        "in": (2.0, 50.8),
        "gon": (200.0, 3.14159265359),
        "arcsec": (3600.0, 0.01745329252),
        "µm": (5.0, 0.005),
        "°C": (20.0, 20.0),
    }
    for text, (value, wanted) in known.items():
        assert unit_named(text, "").convert(value) == pytest.approx(wanted)
    with pytest.raises(BadInput, match="no unit of what is measured"):
        unit_named("deg", "a.toml", "mm")
    with pytest.raises(BadInput, match='unknown unit "furlong"'):
        unit_named("furlong", "a.toml")


def stated(pattern: str) -> str:
    return patterns.pattern_of(TomlTable.parse(f"pattern = '{pattern}'", "map.toml"), "pattern")


@pytest.mark.parametrize("pattern", [r"^(\d+)_", r"^(.+)_[^_]+$", r"(\w+)\s+(\w+)\s+(\w+)"])
def test_a_pattern_of_labels_is_taken_as_it_is(pattern: str) -> None:
    assert stated(pattern) == pattern
    assert patterns.find(pattern, "12_p1 collection group", "f.csv, line 3")


@pytest.mark.parametrize("pattern", [r"^(a+)+$", r"(\w+\s?)+:"])
def test_a_pattern_that_can_take_for_ever_is_refused_when_it_is_read(pattern: str) -> None:
    with pytest.raises(BadInput, match="takes too long on a line such as") as caught:
        stated(pattern)
    assert "map.toml, line 1" in str(caught.value)
    assert "no repeat within a repeat" in str(caught.value)


def test_a_pattern_that_takes_for_ever_on_some_label_is_ended_there() -> None:
    """A hidden one: nothing that it is tried on when it is read is slow."""
    pattern = stated("(?:xyz|xy|z|x|y)*!")
    with pytest.raises(BadInput, match=r"f\.csv, line 3: the pattern .* takes too long") as caught:
        patterns.find(pattern, "xyz" * 100, "f.csv, line 3")
    assert "repeat" in str(caught.value)
    with pytest.raises(BadInput, match="5000 signs"):
        patterns.find(pattern, "x" * 5000, "f.csv, line 3")
    assert patterns.find(pattern, "xyz!", "f.csv, line 3")


TRAILING = {
    "a,b\n1,2\n3,4\nMean,3\n": (r"found 'Mean'.*end = '\^\\W\*Mean'", ","),
    "a;b\n1;2\n3;4\nTotal: 2\n": (r"1 fields found.*end = '\^\\W\*Total'", ";"),
    "a,b\n1,2\na,b\n3,4\n": (r"line 3: the names of line 1 come again.*delete this line", ","),
}


@pytest.mark.parametrize("text", TRAILING)
def test_lines_behind_the_rows_are_refused_with_what_ends_the_table(text: str) -> None:
    says, delimiter = TRAILING[text]

    def first_column(layout: Layout) -> list[float]:
        table = table_of(text, layout, "a.csv")
        return [table.number(row, 0) for row in range(len(table.rows))]

    with pytest.raises(BadInput, match=says):
        first_column(Layout(delimiter=delimiter))
    if "come again" not in says:
        ended = Layout(delimiter=delimiter, end=r"^\W*(Mean|Total)")
        assert first_column(ended) == [1.0, 3.0]
