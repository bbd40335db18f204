"""The settings of a device in the site file, checked against what its kind declares."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.quantity import LARGEST
from calib.toml_table import Asked, TomlTable
from drivers.kind import Kind, Setting


def read_settings(
    table: TomlTable, kind: Kind[Any], actuators: int | None, folder: Path
) -> dict[str, Any]:
    """Read every setting of a kind.

    Parameters
    ----------
    table : TomlTable
        ``[controller]`` or ``[tracker]``.
    actuators : int, optional
        How many the machine has; None where it cannot be read: what hangs on it is not checked.
    folder : Path
        From which paths start.

    Raises
    ------
    BadInput
        For a setting that is missing, of another form or out of its range, with its line.
    """
    values = {}
    for setting in kind.settings:
        values[setting.name] = value = _read(table, setting, actuators, folder)
        table.note(setting.name, _asked(setting, actuators))
        complaint = setting.check(value) if setting.check is not None and value is not None else ""
        if complaint:
            table.complain(complaint, setting.name, remedy=setting.says)
    return values


def _read(table: TomlTable, setting: Setting, actuators: int | None, folder: Path) -> Any:
    """One setting; its default where it is left out."""
    name = setting.name
    if not setting.required and not table.has(name):
        return setting.default
    count = actuators if setting.count == "actuators" else setting.count
    if setting.count == "actuators" and actuators is None:
        return table.raw(name)
    match setting.form:
        case "text":
            return table.choice(name, setting.choices) if setting.choices else table.text(name)
        case "whole":
            most = None if setting.most is None else int(setting.most)
            return table.whole(name, least=int(setting.least or 0), most=most)
        case "number":
            least = -LARGEST if setting.least is None else setting.least
            return table.number(
                name, least=least, most=LARGEST if setting.most is None else setting.most
            )
        case "numbers":
            return table.numbers(name, count or 0, most=setting.most or LARGEST)
        case "flag":
            return table.flag(name, False)
        case "words":
            return _words(table, name, count)
        case "address":
            return ":".join(map(str, read_address(table, name, setting.port)))
        case "file":
            return str((folder / table.text(name)).resolve())
        case "files":
            return [str((folder / path).resolve()) for path in _paths(table, name, count)]
        case "table":
            return _plain(table, name)


def _asked(setting: Setting, actuators: int | None) -> Asked:
    """What the site file's page must say of a setting."""
    kind = " or ".join(setting.choices) or FORM_WORDS[setting.form]
    if setting.form == "numbers":
        kind = f"{actuators if setting.count == 'actuators' else setting.count} numbers"
    default = None if setting.required else setting.default
    if setting.form == "words" and isinstance(default, list):
        default = " ".join(default)
    return Asked(kind, "", setting.required, default)


FORM_WORDS = {
    "text": "text",
    "whole": "whole number",
    "number": "number",
    "numbers": "numbers",
    "flag": "true or false",
    "words": "words in one text",
    "address": "host:port",
    "file": "path",
    "files": "path, or list of paths",
    "table": "any keys",
}


def _words(table: TomlTable, name: str, count: int | None) -> list[str]:
    words = table.text(name).split()
    if count is not None and len(words) != count:
        raise table.wrong(
            f"{name} has {len(words)} words, {count} are wanted", name, remedy=f"Write {count}"
        )
    return words


def _paths(table: TomlTable, name: str, count: int | None) -> list[str]:
    """One path for all, or one for each."""
    if not isinstance(table.raw(name), list):
        return [table.text(name)]
    paths = table.texts(name)
    if count is not None and len(paths) not in (1, count):
        raise table.wrong(
            f"{name} has {len(paths)} paths, 1 or {count} are wanted",
            name,
            remedy=f"Write one path for all, or {count}",
        )
    return paths


def _plain(table: TomlTable, name: str) -> dict[str, Any]:
    value = table.raw(name, "table")
    if not isinstance(value, Mapping):
        raise table.wrong(f"{name} is {value!r}, not a table", name, remedy=f"Write [{name}]")
    return dict(value)


def read_address(table: TomlTable, key: str, default_port: int) -> tuple[str, int]:
    """Read ``host:port``, or a host alone where there is a usual port."""
    text = table.text(key)
    host, colon, port = text.rpartition(":")
    if not colon and default_port:
        return text, default_port
    if not host or not port.isdigit() or not 0 < int(port) < 65536:
        table.complain(f'{key} is "{text}"', key, remedy='Write "host:port"')
        return "", 0
    return host, int(port)
