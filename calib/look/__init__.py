"""The first look at a run: what is wrong with the record itself, named before any physics.

One small file for each kind of hypothesis. Each is a :class:`calib.runs.remark.Remark` with its
evidence, its lines, what was done about it for the analysis, and what to change in the files.
"""

from calib.look.first import first_look

__all__ = ["first_look"]
