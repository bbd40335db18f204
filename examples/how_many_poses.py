"""A study: how many poses, chosen or random, for which accuracy; and does the prediction hold?

First what the design predicts for every number of poses; then a Monte-Carlo over machines: each
is drawn within its tolerances, measured at 15 chosen poses and fitted, and the parameters found
are compared with the true ones, in units of their own uncertainty.

    python examples/how_many_poses.py
"""

import json
from pathlib import Path

import numpy as np

import pkmcal

MACHINES = 6

design = pkmcal.choose_poses("hexapod", 15, candidates=60, seed=1)
print("predicted RMS error at fresh poses")
for one in design.by_count[::10]:
    print(f"  {one.n:3d} poses: {one.position_rms_um:5.1f} um")
print(
    f"  15 poses: chosen {design.predicted.position_rms_um:.1f} um, "
    f"random {design.random_poses.position_rms_um:.1f} um"
)
design.save("poses.toml")

off = []
for seed in range(MACHINES):
    made = pkmcal.simulate("hexapod", f"run-{seed}", seed=seed, poses="poses.toml", noise_um=5.0)
    found = pkmcal.fit(made.run)
    true = json.loads(Path(made.truth).read_text(encoding="utf-8"))["parameters"]
    known = [p for p in found.parameters if p.name in true and p.identified]
    off += [(p.value - true[p.name]) / p.sigma for p in known]
    print(f"machine {seed}: {len(known)} parameters identified, chi2/dof {found.chi2_per_dof:.2f}")

spread = float(np.std(off))
print(f"\ntrue errors are {spread:.2f} times the stated uncertainties (1 is right)")
