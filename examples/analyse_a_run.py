"""Analyse a run: what is wrong with this machine, beyond its dimensions?

A run of a hexapod with play in one leg is simulated; then it is fitted, asked what is missing and
completed, and the model is saved.

    python examples/analyse_a_run.py
"""

import pkmcal

made = pkmcal.simulate("hexapod", "run", seed=7, poses=40, effects={"backlash.leg3": 0.02})
print(f"simulated: {made.readings} readings at {made.poses} poses; hidden: {made.hidden}")

plain = pkmcal.fit(made.run)
print(
    f"\nfit: RMS {plain.rms_um:.1f} um, a perfect model would leave {plain.noise_floor_um:.1f} um"
)

asked = pkmcal.diagnose(made.run)
print("\nwhat is missing?")
for one in asked.candidates[:3]:
    print(f"  {one.effect:16s} p = {one.p_value:.1e}, RMS with it {one.rms_after_um:.1f} um")
print(f"  {asked.advice}")

found = pkmcal.discover(made.run)
print("\nstep by step:")
for step in found.steps:
    name = f"+ {step.added}" if step.added else "geometry"
    print(f"  {name:16s} RMS {step.rms_um:.1f} um, held-out poses {step.holdout_rms_um:.1f} um")
for size in found.parameters:
    print(f"  {size.name} = {size.value:.4f} +- {size.sigma:.4f} {size.unit}")
print(f"  nothing is missing any more: {found.adequate}")

found.save("model.toml")
again = pkmcal.fit(made.run, model="model.toml")
print(f"\nsaved to model.toml; a fit that begins with it: RMS {again.rms_um:.1f} um")
