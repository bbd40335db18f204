"""How long a pattern may look at a line: repeats within repeats can take for ever.

Python's ``re`` has no deadline, and while it looks nothing else runs, the stop key included. So a
pattern is tried when it is read, on lines that grow: of each sign that it holds, of digits, blanks
and commas, ended as they are and by a sign that nobody expects.
"""

import re
import time

LONGEST = 400
"""Signs of a line that a pattern looks at; what is longer holds no reading."""
SHORT, SHORT_S, LONG_S = 24, 0.02, 0.05
_ATOMS = ("1", " ", ",", "a", ".", "1.", "1 ", "1,", "a1", "-1 ")
_MOST_SIGNS = 40


def slow_on(compiled: re.Pattern[str], *, anywhere: bool = False) -> str:
    """A line on which a pattern takes too long, told in words; empty if none was found.

    ``anywhere``: it is searched for in the line; else it is that of the whole line.
    """
    look = compiled.search if anywhere else compiled.fullmatch
    signs = list(dict.fromkeys(compiled.pattern))[:_MOST_SIGNS]
    for atom in dict.fromkeys((*_ATOMS, *signs)):
        for size in (*range(4, SHORT + 1, 2), 32, 48, 72, 100, 150, 225, LONGEST):
            most_s = SHORT_S if size <= SHORT else LONG_S
            for end in ("", "\0"):
                line = (atom * size)[: size - len(end)] + end
                begun = time.process_time()
                look(line)
                if time.process_time() - begun > most_s:
                    return f"it takes too long on a line such as {line[:12]!r}... of {size} signs"
    return ""
