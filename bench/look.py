"""First look: false alarms on clean runs, and everyday mistakes put into them, found or not.

    python -m bench look [--clean 2000] [--each 3] [--seed 1] [--only WORDS]

Each mistake is made on every machine in both orders of measuring, ``--each`` times of other sizes.
Clean runs are simulated on hexapod, tripod and ptm, in both orders of measuring, half of them with
an effect of the mock's catalogue in them: physics must not pass for a mistake in the record.
"""

import argparse
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from itertools import product

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench._first_look import ORDERS, clean, mistaken
from bench.mistakes import MISTAKES, WRONG


def main() -> None:
    """Run both parts and print them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=2000)
    parser.add_argument("--each", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="mistakes whose names hold this")
    asked = parser.parse_args()
    seeds = range(asked.seed, asked.seed + asked.clean)
    cases = [
        (name, machine, order, seed)
        for name, mistake in MISTAKES.items()
        if asked.only in name
        for machine, order in product(mistake.only, ORDERS)
        for seed in range(asked.seed, asked.seed + asked.each)
    ]
    with ProcessPoolExecutor(max_workers=2) as pool:
        looked = list(pool.map(clean, seeds, chunksize=10))
        tried = list(pool.map(mistaken, cases, chunksize=5))
    named = zip(looked, seeds, strict=True)
    alarms = [(seed, *one) for one, seed in named if one[1]]
    print(f"clean runs: {len(looked)}, with a remark: {len(alarms)}")
    for seed, effect, said in alarms:
        print(f"  seed {seed} ({effect}): {', '.join(said)}")
    for name in dict.fromkeys(case for case, _, _ in tried):
        outcomes = Counter(outcome for case, outcome, _ in tried if case == name)
        told = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
        print(f"{name}: {told}")
        words = {said for case, outcome, said in tried if case == name and outcome in WRONG}
        for said in sorted(words):
            print(f"    {said}")


if __name__ == "__main__":
    main()
