"""Templates of pages, read as resources."""
