"""Machines that behave like real ones, in processes of their own, on real wires."""

PART_OF = "pkmcal"
