"""Verbs under the operator's tasks, in the order of work and of ``pkmcal --help``."""

TASKS = (
    (
        "Know the machine",
        ("machine", "kinematics", "poses", "design", "sensitivity", "identifiability"),
    ),
    ("Measure", ("site", "measure", "resume", "attach", "enter", "import")),
    ("Identify", ("fit", "compare", "predict", "fleet")),
    ("Find what the model misses", ("diagnose", "discover")),
    (
        "Correct and prove it",
        ("auto", "apply", "undo", "correct", "export", "verify", "iso9283", "report"),
    ),
    ("Look back", ("sessions", "log", "history")),
    ("Without hardware", ("demo", "mock", "simulate", "reproduce")),
)
