"""Numbers and names that help texts state and jobs begin with: nothing here takes time to load."""

LIMITS: dict[str, float] = {
    "machine": 0.0,
    "frame": 0.0,
    "finite": 0.0,
    "tolerance": 5.0,
    "chi2": 4.0,
    "holdout": 2.0,
    "workspace": 0.0,
    "condition": 2.0,
    "uncertainty": 50.0,
    "gain": 1.0,
    "check-peak": 60.0,
    "check-rms": 1.0,
}
"""Largest values that pass the gates of a write-back; meanings stand with the gates."""
FEWEST_FIRST, MOST_FIRST = 6, 60
"""Poses that an autopilot may begin with."""
REFERENCE_EVERY = 40
"""Poses of a verification between two looks at the base nests."""
UNITS = {"mm": 1.0, "um": 1e-3, "in": 25.4}
"""Units in which numbers are typed, in mm."""
TEMPLATES = ("csv", "gcode-delta", "hal", "p-variables")
"""Forms of an export that are templates."""
PLAIN = ("json", "toml", "urdf")
"""Forms of an export that are written without one."""
