"""A motion controller that speaks a subset of PI GCS 2.0, for the tripod."""
