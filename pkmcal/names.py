"""The names of our packages: taken by us, or said to be taken by somebody else.

``app``, ``calib``, ``drivers`` and ``mocks`` are words that a lab uses as well. Python imports the
first package or module of a name that it finds, so a lab's ``calib.py`` could be imported in place
of ours, and the program would end somewhere inside it. This module needs nothing but Python.
"""

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

PARTS = ("calib", "drivers", "mocks", "app")
"""Packages beside this one, the lowest first."""
ROOT = Path(__file__).resolve().parent.parent
"""The folder that holds all of them."""
MARK = "PART_OF"
"""Every one of them says in this variable whose part it is."""


class NameTaken(ImportError):
    """Another file or package has the name of one of our packages; exit code 2."""


def claim(root: Path = ROOT) -> None:
    """Import our packages (their heads only, nothing heavy), or say who has their names.

    A folder of one of these names that is no package, a folder of data perhaps, harms nobody and
    is passed by.

    Parameters
    ----------
    root : Path
        The folder with our packages.

    Raises
    ------
    NameTaken
        If Python would import, or has imported, another file under one of the names.
    """
    for name in PARTS:
        ours = root / name / "__init__.py"
        if not ours.is_file():  # inside an archive: nothing can be compared
            continue
        loaded = sys.modules.get(name)
        if loaded is None:
            other = _elsewhere(name, ours)
            if other:
                raise _taken(name, other, root)
            loaded = _load(name, ours)
        elif not _same(getattr(loaded, "__file__", None), ours):
            places = [getattr(loaded, "__file__", None), *getattr(loaded, "__path__", ())]
            raise _taken(name, next((str(p) for p in places if p), "a module in memory"), root)
        if getattr(loaded, MARK, "") != "pkmcal":
            raise _overwritten(name, ours)


def _elsewhere(name: str, ours: Path) -> str:
    """The file that Python would import under a name, if it is not ours."""
    found: ModuleSpec | None
    try:
        found = find_spec(name)
    except (ImportError, ValueError):
        found = None
    if found is None or found.origin is None or _same(found.origin, ours):
        return ""
    return found.origin


def _load(name: str, ours: Path) -> ModuleType:
    """Import one of our packages from its own place."""
    spec = spec_from_file_location(name, ours, submodule_search_locations=[str(ours.parent)])
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[name]
        raise _overwritten(name, ours) from error
    return module


def _same(place: str | None, ours: Path) -> bool:
    return place is not None and Path(place).exists() and ours.samefile(place)


def _taken(name: str, place: str, root: Path) -> NameTaken:
    return NameTaken(
        f'{place} has the name "{name}", which is also that of a part of pkmcal (in {root}), and '
        "Python finds it first. Rename it, or keep its folder off PYTHONPATH and away from the "
        "script that is run"
    )


def _overwritten(name: str, ours: Path) -> NameTaken:
    return NameTaken(
        f'{ours} is not pkmcal\'s own: another installed package has the name "{name}" and was '
        "written over it. Install pkmcal in an environment of its own"
    )
