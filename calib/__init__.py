"""The mathematics: mechanisms, identification, discovery. Pure functions over small records."""

PART_OF = "pkmcal"
