"""What became of the machines of a lab over the years: one database in the sessions' folder."""
