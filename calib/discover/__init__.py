"""Diagnosis and discovery of what the model misses."""
