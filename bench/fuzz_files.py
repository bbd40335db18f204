"""Files of every kind, spoilt at random: is each read, or refused in words with its place?

    python -m bench fuzz_files [--count 2000] [--first 0] [--seed 1] [--kind NAME] [--case N]

A whole file of every kind (bench/_fuzz_kinds.py) is spoilt (bench/_fuzz_mutations.py), and the verb
that reads it is asked, in this process; one in two hundred through a process of its own. Found are
tracebacks, warnings of libraries, more than 20 s of CPU or 1 GB of memory, refusals without a
place, and faults of structure or range that were taken. ``--case`` repeats one case and shows it.
"""

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from bench._fuzz_asking import Asked, Asker
from bench._fuzz_kinds import KINDS, Kind, corpus
from bench._fuzz_mutations import Spoilt, spoilt
from bench._reliability_page import Row, write_row

PROCESS_EVERY = 200


def case(kind: Kind, text: str, seed: int, number: int) -> Spoilt:
    """The mutation of that number."""
    return spoilt(text, random.Random(f"{seed} {kind.name} {number}"), kind.form)


def judged(kind: Kind, done: Spoilt, asked: Asked) -> str:
    """What is wrong with an answer; empty if nothing is."""
    if asked.fault:
        return asked.fault
    if asked.code == 0 and done.faulty and not kind.is_free(done.did):
        return f"taken: {done.did}"
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", default="")
    parser.add_argument("--case", type=int)
    parser.add_argument("--page", action="store_true")
    parser.add_argument("--seconds", type=float, default=330.0)
    options = parser.parse_args()
    kinds = [kind for kind in KINDS if options.kind in ("", kind.name)]
    found: Counter[str] = Counter()
    codes: Counter[tuple[str, int]] = Counter()
    first: dict[str, str] = {}
    begun, ran, slowest = time.monotonic(), 0, (0.0, "")
    with tempfile.TemporaryDirectory() as name:
        asker = Asker(corpus(Path(name) / "files"))
        texts = {kind.file: asker.text(kind.file) for kind in kinds}
        for kind in kinds:
            whole_file = asker.ask(kind, texts[kind.file].encode())
            if whole_file.code or whole_file.fault:
                raise SystemExit(f"{kind.name} is refused as it stands: {whole_file}")
        last = options.first + options.count
        numbers = range(options.first, last) if options.case is None else [options.case]
        for number in numbers:
            if time.monotonic() - begun > options.seconds:
                break
            kind = kinds[number % len(kinds)] if options.case is None else kinds[0]
            done = case(kind, texts[kind.file], options.seed, number)
            whole = options.case is None and number % PROCESS_EVERY == PROCESS_EVERY - 1
            asked = asker.ask(kind, done.data, process=whole)
            if options.case is not None:
                print(done.data.decode("utf-8", "replace"), done.did, asked, sep="\n")
            ran += 1
            codes[kind.name, asked.code] += 1
            slowest = max(slowest, (asked.seconds, f"{kind.name} {number}: {done.did}"))
            fault = judged(kind, done, asked)
            if fault:
                key = fault if asked.fault else f"{kind.name} {fault[:60]}"
                found[key] += 1
                first.setdefault(key, f"--kind '{kind.name}' --case {number}: {done.did}")
    for kind in kinds:
        said = ", ".join(f"{n} with {c}" for (k, c), n in sorted(codes.items()) if k == kind.name)
        print(f"{kind.name:26} {said}")
    for fault, count in found.most_common():
        print(f"{count:5}  {fault}\n       {first[fault]}")
    print(f"{ran} files, {sum(found.values())} findings; slowest {slowest[0]:.1f} s, {slowest[1]}")
    print(f"memory {asker.memory_mb():.0f} MB, {time.monotonic() - begun:.0f} s")
    if options.page:
        first_case = f" --first {options.first}" if options.first else ""
        what = f"fuzz_files --count {options.count}{first_case} --seed {options.seed}"
        refused = sum(n for (_, code), n in codes.items() if code == 2)
        says = f"{sum(found.values())} found; {refused} refused, the others read"
        memory = f"slowest {slowest[0]:.1f} s, {asker.memory_mb():.0f} MB"
        write_row("files", Row(what, f"{ran} files of {len(kinds)} kinds", f"{says}; {memory}"))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
