"""First look: false alarms on clean runs, and everyday mistakes put into them, found or not.

    python -m bench look [--clean 2000] [--each 20] [--seed 1]

Clean runs are simulated on hexapod, tripod and ptm, in both orders of measuring, half of them with
an effect of the mock's catalogue in them: physics must not pass for a mistake in the record.
"""

import argparse
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench._first_look import clean, mistaken
from bench._record_mistakes import MISTAKES


def main() -> None:
    """Run both parts and print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=2000)
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.clean)
    cases = [(name, k) for name in MISTAKES for k in range(asked.seed, asked.seed + asked.each)]
    with ProcessPoolExecutor(max_workers=2) as pool:
        looked = list(pool.map(clean, seeds, chunksize=10))
        tried = list(pool.map(mistaken, cases, chunksize=5))
    named = zip(looked, seeds, strict=True)
    alarms = [(seed, *one) for one, seed in named if one[1]]
    print(f"clean runs: {len(looked)}, with a remark: {len(alarms)}")
    for seed, effect, said in alarms:
        print(f"  seed {seed} ({effect}): {', '.join(said)}")
    for name in MISTAKES:
        outcomes = Counter(outcome for case, outcome in tried if case == name)
        others = ", ".join(f"{k} x {said}" for said, k in outcomes.items() if said != "found")
        print(
            f"{name}: {outcomes['found']} of {asked.each} named{f' ({others})' if others else ''}"
        )


if __name__ == "__main__":
    main()
