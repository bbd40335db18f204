"""Shares and medians with their 95 % intervals, as the pages show them."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import beta, binom


def median(values: Sequence[float]) -> str:
    """The median, and order statistics that hold it with 95 %, whatever the distribution."""
    ordered, count = sorted(values), len(values)
    low = max(int(binom.ppf(0.025, count, 0.5)), 1)
    return f"{np.median(ordered):.3g} ({ordered[low - 1]:.3g}, {ordered[count - low]:.3g})"


def share(true: Sequence[bool | None]) -> str:
    """A share with its interval by Clopper and Pearson; a dash where nobody was asked."""
    if None in true or not true:
        return "-"
    k, n = sum(map(bool, true)), len(true)
    low = beta.ppf(0.025, k, n - k + 1) if k else 0.0
    high = beta.ppf(0.975, k + 1, n - k) if k < n else 1.0
    return f"{100 * k / n:.0f} % ({100 * low:.0f}, {100 * high:.0f})"
