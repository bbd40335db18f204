"""Maps that ship: how programs write their tables, read as resources."""
