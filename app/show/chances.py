"""Probabilities as people read them."""


def chance(log10_p: float | None) -> str:
    """Two digits of a probability of any smallness; "-" where there is none."""
    if log10_p is None:
        return "-"
    return f"{10**log10_p:.2g}" if log10_p > -300.0 else f"1e{log10_p:.0f}"
