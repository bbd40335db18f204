"""The operator's side: command line, routines, journal, screens and reports."""

import os

# The matrices here have tens to hundreds of rows: threads of the linear algebra cost more than
# they give. Read when numpy is loaded; a setting of the operator's own stands.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PART_OF = "pkmcal"
