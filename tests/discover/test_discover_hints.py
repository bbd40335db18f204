"""One effect more needs more than chance; what is unknown says what it is like."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.discover.likeness import likeness_of, likeness_words
from calib.evidence.forward import discover, hints


def diagnosis(*called: tuple[str, float], unexplained: bool = False) -> Any:
    """What a stage says: effects called for with their log p."""
    return SimpleNamespace(
        explained_by=tuple(name for name, _ in called),
        findings=[SimpleNamespace(name=name, log_p=log_p) for name, log_p in called],
        unknown_preferred=False,
        indistinguishable=(),
        adequate=not called,
        unexplained=SimpleNamespace(significant=unexplained),
    )


@dataclass
class Lab:
    """Backlash is there beyond doubt; a second effect by a p-value that is given."""

    second: float
    asked: list[tuple[str, ...]] = field(default_factory=list)

    def __call__(self, names: tuple[str, ...]) -> Any:
        self.asked.append(names)
        called = [("backlash", -200.0)] if "backlash" not in names else []
        if "contact" not in names:
            called.append(("contact", np.log(self.second)))
        return SimpleNamespace(
            effects=names,
            holdout=10.0 - len(names),
            diagnosis=diagnosis(*called),
            doubtful=frozenset(),
        )


@pytest.mark.parametrize(("p", "found"), [(1e-4, True), (5e-3, False)])
def test_a_second_effect_that_may_be_chance_is_a_hint(p: float, found: bool) -> None:
    staircase = discover(Lab(p))
    assert ("contact" in staircase.last.effects) is found
    last = staircase.last
    assert hints(last.diagnosis, last.effects) == (() if found else ("contact",))
    assert hints(last.diagnosis, ()) == ()


def test_a_first_effect_needs_no_more_than_before() -> None:
    class Faint(Lab):
        def __call__(self, names: tuple[str, ...]) -> Any:
            stage = super().__call__(("backlash", *names))
            stage.effects = names
            return stage

    staircase = discover(Faint(5e-3))
    assert staircase.last.effects == ("contact",)


@pytest.mark.parametrize(("p", "refused"), [(5e-3, True), (1e-4, False)])
def test_a_weak_call_for_a_value_that_cannot_be_is_chance(p: float, refused: bool) -> None:
    class Faint(Lab):
        def __call__(self, names: tuple[str, ...]) -> Any:
            called = [(name, np.log(p)) for name in ("contact", "settling") if name not in names]
            return SimpleNamespace(
                effects=names,
                holdout=10.0 - len(names),
                diagnosis=diagnosis(*called),
                doubtful=frozenset(),
            )

    staircase = discover(Faint(p), forbids=lambda stage, name: name == "contact")
    assert staircase.impossible == (("contact",) if refused else ())
    assert staircase.last.effects == (() if refused else ("contact", "settling"))
    named = hints(staircase.last.diagnosis, staircase.last.effects, staircase.impossible)
    assert named == (("contact", "settling") if refused else ())


def test_likeness_is_the_cosine_between_what_is_there_and_the_nearest_effect() -> None:
    rng = np.random.default_rng(3)
    count, freedom = 400, 380.0
    effect = rng.normal(size=count)
    effect /= np.linalg.norm(effect)
    other = rng.normal(size=count)
    other -= effect * (effect @ other)
    other /= np.linalg.norm(other)
    hidden = 200.0 * (0.8 * effect + 0.6 * other)
    noise = rng.normal(size=count)
    noise *= np.sqrt(freedom) / np.linalg.norm(noise)
    residual = hidden + noise
    one = SimpleNamespace(name="backlash", chi2_fall=float(effect @ residual) ** 2, dof=1)
    problem = SimpleNamespace(residual=residual, trace=freedom)
    asked = SimpleNamespace(
        findings=[one],
        unexplained=SimpleNamespace(significant=True),
        scores=SimpleNamespace(problem=problem),
    )
    found = likeness_of(asked)  # type: ignore[arg-type]
    assert found is not None
    assert found["effects"] == ["backlash"]
    assert found["value"] == pytest.approx(0.8, abs=0.03)
    assert "like backlash (0.8), but not backlash" in likeness_words(found, "it depends on q3")
    nearly = found | {"value": 0.99}
    assert "98 %" in likeness_words(nearly, "it depends on q3", ["backlash"])
    assert "but not" in likeness_words(nearly, "it depends on q3", ["contact"])
    asked.unexplained = SimpleNamespace(significant=False)
    assert likeness_of(asked) is None  # type: ignore[arg-type]


def test_what_is_like_an_effect_of_a_later_round_is_not_said_of_the_first() -> None:
    class Grouped(Lab):
        def __call__(self, names: tuple[str, ...]) -> Any:
            stage = super().__call__(names)
            if not names:
                rival, other = ("backlash", "hysteresis"), ("contact", "lead-variation")
                stage.diagnosis.indistinguishable = (rival, (*other, "backlash"))
            return stage

    assert discover(Grouped(5e-3)).indistinguishable == (("backlash", "hysteresis"),)
