"""The table ``[noise]`` of a model file: the noise with which a fit counted."""

import math
from dataclasses import dataclass
from typing import Any

from calib.identify import Fit
from calib.noise import Component, Noise
from calib.toml_table import TomlTable


@dataclass(frozen=True)
class SavedNoise:
    """Noise from a model file, and its components with their uncertainties."""

    noise: Noise
    components: tuple[Component, ...] = ()


def noise_tables(fit: Fit) -> dict[str, Any]:
    """The table as it is written."""
    noise = fit.noise
    sizes = {
        "scale": noise.scale, "tau_s": noise.tau_s, "share": noise.share, "visit": noise.visit,
        "by_row": noise.by_row, "step": noise.step,
    }  # fmt: skip
    components = [
        {
            "name": one.name,
            "value": one.value,
            **({"sigma": one.sigma} if math.isfinite(one.sigma) else {}),
            "p_value": one.p_value,
        }
        for one in fit.components_of_noise
    ]
    table: dict[str, Any] = {**sizes, "scatter": dict(noise.scatter), "components": components}
    return {"noise": table}


def read_noise(top: TomlTable) -> SavedNoise | None:
    """Read this table; None where it is missing, as in files of before.

    Raises
    ------
    BadInput
        For sizes that no noise has.
    """
    if not top.has("noise") or top.as_it_stands().get("format") == "pkm-fit/1":
        return None
    table = top.table("noise")
    sizes = table.numbers_by_name("scatter")
    for name, size in sizes.items():
        if not size > 0.0:
            raise table.wrong(f"{name} is {size:g}", "scatter", remedy="Fit again")
    noise = Noise(
        scale=table.number("scale", 1.0, least=1e-3, most=1e3),
        tau_s=table.number("tau_s", 0.0, unit="s", least=0.0),
        share=table.number("share", 1.0, least=0.0, most=1.0),
        visit=table.number("visit", 0.0, least=0.0),
        by_row=table.flag("by_row", False),
        step=table.number("step", 0.0, least=0.0),
        scatter=tuple(sizes.items()),
    )
    return SavedNoise(noise, tuple(_component(one) for one in table.tables("components")))


def _component(entry: TomlTable) -> Component:
    sigma = entry.optional_number("sigma")
    return Component(
        entry.text("name"),
        entry.number("value"),
        math.inf if sigma is None else sigma,
        entry.number("p_value", 1.0),
    )
