"""What the verbs and the scripting interface do alike: from files to a report, without words.

One module for each question. A function takes what an operator says and returns a report, a
record with the fields of the verb's JSON answer; the verb prints it, a script goes on with it.
:mod:`pkmcal` hands these functions and records on.
"""
