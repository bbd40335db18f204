"""Drawings and words for the terminal and for files."""
