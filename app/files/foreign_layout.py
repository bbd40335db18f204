"""How a text holds a table: stated in a map, never guessed."""

from dataclasses import dataclass

from app.files.patterns import pattern_of
from calib.toml_table import TomlTable

DELIMITERS = {",": ",", ";": ";", "tab": "\t", "|": "|", "blanks": ""}
ENCODINGS = ("utf-8", "latin-1", "cp1252", "utf-16")
THOUSANDS = ("", ",", ".", "'", " ")


@dataclass(frozen=True)
class Layout:
    """How a text holds a table.

    Attributes
    ----------
    delimiter : str
        One of :data:`DELIMITERS`.
    decimal, thousands : str
        Sign before the decimals, and the sign between thousands (none: "").
    comments : tuple of str
        Beginnings of lines that are none of the table's.
    skip : int
        Lines before the table, of any kind.
    after, end : str
        Patterns: the table begins behind the first line in which ``after`` is found, and ends
        before one in which ``end`` is.
    header, units_row : bool
        Whether a line of names comes first, and one of units behind it.
    missing : tuple of str
        Cells that say that there is nothing.
    fields : int
        Cells that every row has; 0: as many as the first.
    """

    encoding: str = "utf-8"
    delimiter: str = ","
    decimal: str = "."
    thousands: str = ""
    comments: tuple[str, ...] = ()
    skip: int = 0
    after: str = ""
    end: str = ""
    header: bool = True
    units_row: bool = False
    missing: tuple[str, ...] = ()
    fields: int = 0


def layout_of(table: TomlTable) -> Layout:
    """Read the table ``[file]`` of a map; raises BadInput with line and key."""
    decimal = table.choice("decimal", (".", ","), ".")
    thousands = table.choice("thousands", THOUSANDS, "")
    delimiter = table.choice("delimiter", tuple(DELIMITERS), ",")
    if thousands == decimal:
        raise table.wrong("thousands and decimals have one sign", "thousands")
    if delimiter == decimal:
        raise table.wrong(
            "a comma cannot stand between columns and before decimals", "decimal",
            remedy='Such files have delimiter = ";" or "tab"',
        )  # fmt: skip
    if thousands == " " and delimiter == "blanks":
        raise table.wrong("blanks cannot stand between columns and thousands", "thousands")
    layout = Layout(
        encoding=table.choice("encoding", ENCODINGS, "utf-8"),
        delimiter=delimiter,
        decimal=decimal,
        thousands=thousands,
        comments=tuple(table.texts("comments")),
        skip=table.whole("skip", 0),
        after=pattern_of(table, "after"),
        end=pattern_of(table, "end"),
        header=table.flag("header", True),
        units_row=table.flag("units_row", False),
        missing=tuple(table.texts("missing")),
        fields=table.whole("fields", 0),
    )
    table.end()
    return layout
