"""What devices may send, spoilt at random: is it taken apart, or refused as a typed fault?

    python -m bench fuzz_packets [--count 1000000] [--seed 1] [--target NAME] [--guided] [--page]

Parsers of emScon, slcan (with the CANopen network behind it), GCS, GeoCOM and lines take whole
packets that were spoilt (bench/_fuzz_packets.py). Found are exceptions that are no DeviceError,
numbers that are let through and are none, and packets that take longer than a second. ``--guided``
follows coverage with atheris (libFuzzer), where that is installed: pip install pkmcal[fuzz]. Each
target is then shaken in a process of its own, which ends at the first finding.
"""

import argparse
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path

from bench._reliability_page import Row, write_row

CHILD = "--child"
if CHILD in sys.argv:
    import atheris  # type: ignore[import-not-found]

    with atheris.instrument_imports(include=["drivers"]):  # only what is imported here is followed
        import drivers.gcs.line
        from bench._fuzz_packets import Target, fault, stream, targets
else:
    import drivers.gcs.line
    from bench._fuzz_packets import Target, fault, stream, targets


LONGEST_S = 1.0
LIMIT_MB = 100


def named(error: Exception) -> str:
    """An exception by its kind and its place."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} at {'/'.join(frame.filename.split('/')[-2:])}:{frame.lineno}"


def shaken(target: Target, seed: int, count: int, until: float) -> tuple[int, float, Counter[str]]:
    """Packets of one target; returns how many, the longest time, and what was found."""
    dice = random.Random(f"{seed} {target.name}")
    found: Counter[str] = Counter()
    longest, ran = 0.0, 0
    while ran < count and (ran % 1000 or time.monotonic() < until):
        data = stream(target, dice)
        begun = time.process_time()
        error = fault(target, data)
        spent = time.process_time() - begun
        longest = max(longest, spent)
        ran += 1
        if error is not None:
            key = named(error)
            if not found[key]:
                print(f"{target.name}: {key}: {error}\n  {data[:120]!r}")
            found[key] += 1
        elif spent > LONGEST_S:
            found[f"{spent:.1f} s"] += 1
    return ran, longest, found


def guided(target: Target, options: argparse.Namespace) -> None:
    """Follow coverage from the seeds; ends the process, with 77 where something was found."""

    def take(data: bytes) -> None:
        error = fault(target, data)
        if error is not None:
            raise error

    with tempfile.TemporaryDirectory() as folder:
        for number, seed_of in enumerate(target.seeds):
            (Path(folder) / str(number)).write_bytes(seed_of)
        words = [sys.argv[0], f"-runs={options.count}", f"-seed={options.seed}", "-max_len=6000"]
        words += [
            f"-max_total_time={options.seconds:.0f}",
            "-timeout=2",
            f"-artifact_prefix={folder}/",
        ]
        atheris.Setup([*words, folder], take)
        atheris.Fuzz()


def told(target: Target, options: argparse.Namespace) -> tuple[int, bool, str]:
    """Guided packets of one target, in a process of its own: how many, whether found, and words."""
    command = [sys.executable, "-m", "bench.fuzz_packets", CHILD, "--target", target.name]
    command += ["--count", str(options.count), "--seed", str(options.seed)]
    command += ["--seconds", str(options.seconds)]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    said = done.stderr + done.stdout
    ran = re.findall(r"(?:Done |^#)(\d+)", said, re.MULTILINE)
    seen = re.findall(r"cov: (\d+).*?rss: (\d+)Mb", said)
    found = done.returncode != 0
    if found or not (ran and seen):
        print(said[-3000:])
    first, last = seen[0], seen[-1]
    more = int(last[1]) - int(first[1])
    words = f"{int(found)} found, {first[0]} edges of the drivers at first, {last[0]} at last"
    return int(ran[-1]), found or more > LIMIT_MB, f"{words}, {more} MB more"


def _all_guided(chosen: list[Target], options: argparse.Namespace) -> int:
    wrong = 0
    for target in chosen:
        ran, found, says = told(target, options)
        wrong += found
        print(f"{target.name:8} {ran} packets: {says}", flush=True)
        if options.page:
            what = f"fuzz_packets --guided --target {target.name} --seed {options.seed}"
            write_row("packets", Row(what, f"{ran} packets of {target.name}, guided", says))
    return 1 if wrong else 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--target", default="")
    parser.add_argument("--seconds", type=float, default=340.0)
    parser.add_argument("--guided", action="store_true")
    parser.add_argument(CHILD, action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    drivers.gcs.line.ANSWER_S = 0.0  # nothing more comes: no waiting for it
    chosen = [one for one in targets().values() if options.target in ("", one.name)]
    if options.child:
        guided(chosen[0], options)
    if options.guided:
        return _all_guided(chosen, options)
    begun = time.monotonic()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    faults = 0
    for target in chosen:
        until = begun + options.seconds
        ran, longest, found = shaken(target, options.seed, options.count, until)
        more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024 - before
        says = f"{sum(found.values())} found, longest {1000 * longest:.0f} ms, {more:.0f} MB more"
        print(f"{target.name:8} {ran} packets: {says}")
        faults += sum(found.values()) + (more > LIMIT_MB)
        if options.page:
            what = f"fuzz_packets --target {target.name} --seed {options.seed}"
            write_row("packets", Row(what, f"{ran} packets of {target.name}", says))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
