"""A verification in words: the table of errors, with the earlier ones beside them."""

from typing import Any

from app.show.text_table import text_table


def verdict(found: dict[str, Any]) -> str:
    """The table of a verification, with the earlier one beside it."""
    rows: list[tuple[str, ...]] = []
    views = [("measured", "measured"), *([("truth", "true")] if found["truth"] else [])]
    for when, data in (("before", found["before"]), ("now", found)):
        rows += [
            (
                f"{name}, {when}",
                f"{data[key]['position_peak_um']:.1f}",
                f"{data[key]['position_std_um']:.1f}",
                f"{data[key]['orientation_peak_deg']:.4f}",
                f"{data[key]['orientation_std_deg']:.4f}",
            )
            for key, name in views
            if data and data.get(key)
        ]
    peaks = [("tracker noise alone", found["noise_alone"])]
    if found["truth"]:  # a mock: beside it what was published of such a machine
        peaks.append(("Han et al. 2020, after", found["paper"]))
    for name, data in peaks:
        rows.append(
            (name, f"{data['position_peak_um']:.1f}", "", f"{data['orientation_peak_deg']:.4f}", "")
        )
    head = ("", "peak um", "std um", "peak deg", "std deg")
    return f"{found['poses']} poses\n" + text_table(head, rows)
