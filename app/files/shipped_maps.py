"""Maps that ship with the program."""

from importlib.resources import files

from calib.errors import BadInput


def shipped_maps() -> tuple[str, ...]:
    """Their names."""
    return tuple(
        sorted(
            entry.name.removesuffix(".toml")
            for entry in files("app.import_maps").iterdir()
            if entry.name.endswith(".toml")
        )
    )


def shipped_map(name: str) -> str:
    """The text of a shipped map; raises BadInput naming those that there are."""
    if name not in shipped_maps():
        raise BadInput(
            f'there is no map "{name}"',
            place="--map",
            remedy=f"Name a file, or one of {', '.join(shipped_maps())}",
        )
    return files("app.import_maps").joinpath(f"{name}.toml").read_text(encoding="utf-8")
