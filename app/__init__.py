"""The operator's side: command line, routines, journal, screens and reports."""
