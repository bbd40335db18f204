"""False alarms, coverage and power where noise is other than the readings state.

    python -m bench noise [--runs 200] [--power 60] [--seed 1] [--out FILE] [--minutes 5]
                          [--conditions white ar:0.2 ...] [--page docs/noise.md]

Clean runs of the mock hexapod, the four sets of poses of the blind trial in turn, are discovered
under every condition: whether an effect is named, whether something unknown is declared, and
whether the 68 % intervals of what was identified of the machine hold its true parameters. Then
runs that hide one effect at size 1: how often it is significant where the noise is estimated, and
where it is known to the test. Every run is a line of FILE, of which the same command goes on; no
run is begun after so many minutes. ``--page`` rewrites the table between the marks of a page.
"""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from bench._blind_cases import SIGMA_MM, Case, build, draw_cases, draw_nulls
from bench._intervals import share
from bench.blind import machine_named, poses_of
from calib.discover.diagnosis import RunDiagnosis, diagnose_fit
from calib.discover.discovery import SEED, Refitter, discover_run, stage_of
from calib.effects import catalogue
from calib.identify.fitting import Fit, with_noise
from calib.noise import Noise
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.files import points_csv, run_toml

MACHINE = "hexapod"
CONDITIONS = {
    "white": "white, as stated",
    "ar:0.2": "autoregressive, 0.2 between successive readings",
    "ar:0.5": "autoregressive, 0.5",
    "walk:0.3": "white, and a walk by 0.3 sigma a reading",
    "t:5": "Student's t of 5 degrees of freedom",
    "scale:0.8": "0.8 times what is stated",
    "scale:1.5": "1.5 times",
    "nest:1.6": "one nest 1.6 times what is stated",
    "along:1.5": "1.5 times along the beam",
    "added:1": "5 um beside a tracker's covariances",
    "range:0.6": "beside what is stated 3 um/m of range",
}
BEGIN, END = "<!-- bench noise: begin -->", "<!-- bench noise: end -->"


@dataclass(frozen=True)
class Line:
    """One run: what was found, or how its hidden effect was seen.

    ``inside`` of ``identified`` parameters lie within their 68 % interval; ``estimated`` and
    ``known``: whether the hidden effect was significant (None where none was hidden, and where no
    filter knows the noise).
    """

    kind: str
    condition: str
    seed: int
    named: tuple[str, ...] = ()
    unknown: bool = False
    components: tuple[str, ...] = ()
    inside: int = 0
    identified: int = 0
    effect: str = ""
    estimated: bool | None = None
    known: bool | None = None


def refitter(case: Case) -> tuple[Refitter, Mapping[str, float]]:
    """The readings of a case, ready to be fitted, and the true parameters of its machine."""
    simulated, _ = build(case, poses_of(case))
    machine = machine_named(case.machine)
    run = parse_run(run_toml(simulated), points_csv(simulated), actuators=len(machine.actuators))
    return Refitter(stack(machine, [run]), catalogue(machine)), simulated.parameters


def clean(case: Case, condition: str) -> Line:
    """Discover a run in which nothing is hidden."""
    refit, truth = refitter(case)
    found = discover_run(refit)
    first, last = stage_of(found, 0), stage_of(found).run
    named = first.diagnosis.best
    fit = last.fit
    count = fit.model.free.size
    pulls = [
        (fit.values[k] - truth[name]) / fit.sigmas[k]
        for k, name in enumerate(fit.model.names[:count])
        if fit.sigmas[k] < 0.5 * fit.model.prior[k]
    ]
    return Line(
        "clean", condition, case.seed, (named.name,) if named else (),
        named is None and not first.diagnosis.adequate,
        tuple(
            f"{one.name} {one.value:.3g} p {one.p_value:.1g}"
            for one in last.fit.components_of_noise
        ),
        int(np.sum(np.abs(pulls) < 1.0)), len(pulls),
    )  # fmt: skip


def hidden(case: Case, condition: str) -> Line:
    """See a hidden effect against noise that is estimated, and against noise that is known."""
    refit, _ = refitter(case)
    effect = case.effects[0]
    estimated = refit(()).run
    truth = true_noise(condition, refit.fit(()))
    known = None
    if truth is not None:
        noisy = with_noise(refit.fit(()), truth)
        answer = diagnose_fit(noisy, catalogue(machine_named(MACHINE)), np.random.default_rng(SEED))
        known = significant(answer, effect)
    return Line(
        "hidden", condition, case.seed, effect=effect,
        estimated=significant(estimated, effect), known=known,
    )  # fmt: skip


def true_noise(condition: str, fit: Fit) -> Noise | None:
    """What a condition is as components; None where they cannot say it."""
    name, _, amount = condition.partition(":")
    if name == "scale":
        return Noise(scale=float(amount))
    if name == "ar":
        return Noise(tau_s=-fit.taking.usual_gap_s / float(np.log(float(amount))), by_row=True)
    own = {
        "nest": (f"nest {_first_nest(fit)}", 1.0), "along": ("along", 1.0),
        "added": ("added", 1000.0 * SIGMA_MM), "range": ("range", 1000.0 * SIGMA_MM),
    }  # fmt: skip
    if name in own:
        component, unit = own[name]
        return Noise(scatter=((component, unit * float(amount)),))
    return Noise() if name == "white" else None


def _first_nest(fit: Fit) -> str:
    rows = fit.model.rows
    return next(name for name, on in zip(rows.nest_name, rows.on_platform, strict=True) if on)


def significant(answer: RunDiagnosis, effect: str) -> bool:
    """Whether an effect is called for."""
    return any(one.name == effect and one.p_value <= 0.05 for one in answer.diagnosis.findings)


def asked(
    runs: int, power: int, seed: int, conditions: Sequence[str]
) -> Iterator[tuple[Callable[[Case, str], Line], str, Case, str]]:
    """Every run to be made, the conditions in turn."""
    nulls = draw_nulls(runs, seed, MACHINE)
    singles = [
        case for case in draw_cases(20 * max(power, 1), seed, MACHINE)
        if case.kind == "single" and case.sizes == (1.0,)
    ][:power]  # fmt: skip
    for k in range(max(runs, power)):
        for condition in conditions:
            noise = "" if condition == "white" else condition
            if k < runs:
                yield clean, "clean", replace(nulls[k], noise=noise), condition
            if k < len(singles) and condition.partition(":")[0] not in ("walk", "t"):
                yield hidden, "hidden", replace(singles[k], noise=noise), condition


def read(file: Path | None) -> list[Line]:
    """Lines that were written already."""
    if file is None or not file.exists():
        return []
    lines = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return [
        Line(**{key: tuple(v) if isinstance(v, list) else v for key, v in line.items()})
        for line in lines
    ]


def table(lines: Sequence[Line]) -> list[str]:
    """A row for each condition; in brackets the 95 % interval."""
    heads = (
        "noise", "clean runs", "an effect is named", "something unknown is declared",
        "68 % intervals hold", "power: estimated, known", "of runs",
    )  # fmt: skip
    text = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for condition, says in CONDITIONS.items():
        own = [line for line in lines if line.condition == condition]
        nulls = [line for line in own if line.kind == "clean"]
        if not nulls:
            continue
        seen = [line for line in own if line.kind == "hidden" and line.known is not None]
        power = (
            f"{100 * np.mean([line.estimated for line in seen]):.0f}, "
            f"{100 * np.mean([line.known for line in seen]):.0f} %"
            if seen
            else "-"
        )
        cells = (
            says, str(len(nulls)), share([bool(line.named) for line in nulls]),
            share([line.unknown for line in nulls]), _coverage(nulls), power,
            str(len(seen) or "-"),
        )  # fmt: skip
        text.append("| " + " | ".join(cells) + " |")
    return text


def _coverage(nulls: Sequence[Line]) -> str:
    """Share of intervals that hold; its error from run to run: those of one run hang together."""
    inside = np.array([line.inside for line in nulls], dtype=float)
    identified = np.array([line.identified for line in nulls], dtype=float)
    mean = inside.sum() / identified.sum()
    spread = np.std(inside - mean * identified) / identified.mean() / np.sqrt(len(nulls))
    return f"{100 * mean:.1f} +- {100 * spread:.1f} %"


def alarms(lines: Sequence[Line]) -> str:
    """Which effects were named where nothing was hidden."""
    names = [name for line in lines for name in line.named]
    return ", ".join(f"{name} {names.count(name)}" for name in sorted(set(names))) or "none"


def written(page: Path, text: Sequence[str]) -> None:
    """Put the table between the marks of a page."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    page.write_text("\n".join([before + BEGIN, *text, END + after]), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--power", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--conditions", nargs="+", default=list(CONDITIONS), choices=CONDITIONS)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--minutes", type=float, default=np.inf)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    lines = read(options.out)
    there = {(line.kind, line.condition, line.seed) for line in lines}
    began = time.monotonic()
    for solve, kind, case, condition in asked(
        options.runs, options.power, options.seed, options.conditions
    ):
        if (kind, condition, case.seed) in there:
            continue
        if time.monotonic() - began > 60.0 * options.minutes:
            break
        lines.append(solve(case, condition))
        if options.out:
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(lines[-1])) + "\n")
    text = table(lines)
    print("\n".join(text), f"\n\nNamed where nothing was hidden: {alarms(lines)}")
    if options.page is not None:
        written(options.page, text)


if __name__ == "__main__":
    main()
