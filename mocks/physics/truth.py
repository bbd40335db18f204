"""The parameters that a mock machine really has."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from mocks.physics.table_file import numbers_by_name, read_table


@cache
def machine_file(name: str) -> Machine:
    """The shipped machine file of this name; raises FileNotFoundError if there is none."""
    source = files("calib").joinpath("machines", f"{name}.toml")
    return parse_machine(source.read_text(encoding="utf-8"), f"{name}.toml")


def nominal_parameters(machine: Machine) -> dict[str, float]:
    """Nominal values by name, mm and rad."""
    return {p.name: p.nominal for p in machine.parameters}


def draw_parameters(machine: Machine, seed: int, prior: str = "uniform") -> dict[str, float]:
    """Nominal plus manufacturing errors, drawn by ``seed``.

    ``prior`` "uniform": within +- tolerance; "normal": the Gaussian prior of the machine file.
    """
    rng = np.random.default_rng([seed, 1])
    tolerance = np.array([p.tolerance for p in machine.parameters])
    sigma = np.array([p.sigma for p in machine.parameters])
    draws = {
        "uniform": tolerance * rng.uniform(-1.0, 1.0, tolerance.size),
        "normal": sigma * rng.standard_normal(sigma.size),
    }[prior]
    return {p.name: p.nominal + float(e) for p, e in zip(machine.parameters, draws, strict=True)}


def read_parameters(path: Path, machine: Machine) -> dict[str, float]:
    """True parameters from a TOML or JSON file, table ``parameters`` or the whole file.

    Missing ones are nominal. Raises ValueError for a name that the machine does not have.
    """
    table = read_table(path)
    inner = table.get("parameters", table)
    if not isinstance(inner, Mapping):
        raise ValueError(f"{path}: parameters must be a table of names and numbers")
    truth = nominal_parameters(machine)
    for name, value in numbers_by_name(inner, f"{path}: parameter").items():
        if name not in truth:
            raise ValueError(f'{path}: machine {machine.name} has no parameter "{name}"')
        truth[name] = value
    return truth
