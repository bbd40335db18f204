"""Readings that scatter otherwise than they state: found back, honestly, and where none do, none.

A fit with some unknowns to readings of four nests a visit; sigmas, ranges and beams differ.
"""

from dataclasses import replace

import numpy as np
import pytest

from calib.evidence import LinearProblem
from calib.noise import Noise, Scatter, Taking, Whitening, estimate, points_to_scatter

VISITS, NESTS, UNKNOWNS = 50, 4, 16
COUNT = VISITS * NESTS


def taken(rng: np.random.Generator) -> Taking:
    """Readings with sigmas of 3 to 12 um from 1 to 6 m, nest by nest."""
    sigma_um, metres = rng.uniform(3.0, 12.0, COUNT), rng.uniform(1.0, 6.0, COUNT)
    beam = rng.standard_normal((3, COUNT))
    nest = np.arange(COUNT) % NESTS
    each = np.eye(3)[:, :, None] / sigma_um**2
    scatter = Scatter(
        {f"nest {k + 1}": nest == k for k in range(NESTS)},
        beam / np.linalg.norm(beam, axis=0),
        {"added": each, "range": each * metres**2},
    )
    motions = rng.standard_normal((6, 3, COUNT))
    order = 10.0 * np.arange(COUNT)
    visit = np.arange(COUNT) // NESTS
    return Taking(np.zeros(COUNT, dtype=np.intp), order, visit, motions, scatter=scatter)


def read(taking: Taking, noise: Noise, rng: np.random.Generator, freedom: float = 0.0):
    """What a fit leaves of white noise with such scatter; Student's t where freedom is given."""
    drawn = rng.standard_normal((3, COUNT))
    if freedom:
        drawn = rng.standard_t(freedom, (3, COUNT)) / np.sqrt(freedom / (freedom - 2.0))
    root, _ = taking.scatter.roots(noise.scatter)
    noisy = noise.scale * np.einsum("nij,jn->in", root, drawn).reshape(-1)
    jacobian = rng.standard_normal((UNKNOWNS, 3 * COUNT))
    gone = np.linalg.lstsq(jacobian.T, noisy, rcond=None)[0]
    return LinearProblem(noisy - gone @ jacobian, jacobian, np.zeros(UNKNOWNS))


CASES = {
    "nest 2": Noise(scatter=(("nest 2", 1.6),)),
    "along": Noise(scatter=(("along", 1.5),)),
    "across": Noise(scatter=(("across", 0.7),)),
    "added": Noise(scatter=(("added", 6.0),)),
    "range": Noise(scatter=(("range", 2.0),)),
}


LONG = ("across", "range")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if name in LONG else ()) for name in CASES]
)
def test_scatter_is_found_back_with_honest_uncertainty(name: str) -> None:
    noise = CASES[name]
    pulls = []
    for seed in range(4):
        rng = np.random.default_rng([seed, 5])
        taking = taken(rng)
        found = estimate(read(taking, noise, rng), taking)
        clear = [one for one in found.components if one.p_value < 1e-3]
        assert [one.name for one in clear] == [name], seed
        pulls.append((clear[0].value - noise.scatter[0][1]) / clear[0].sigma)
        assert clear[0].sigma < 0.25 * clear[0].value
    assert np.max(np.abs(pulls)) < 3.5
    assert 0.4 < np.sqrt(np.mean(np.square(pulls))) < 1.8


@pytest.mark.parametrize("freedom", [0.0, 5.0])
def test_readings_that_all_scatter_alike_have_no_component(freedom: float) -> None:
    told, pointed = 0, []
    for seed in range(5):
        rng = np.random.default_rng([seed, 6])
        taking = taken(rng)
        problem = read(taking, Noise(), rng, freedom)
        pointed.append(points_to_scatter(problem, taking))
        components = estimate(problem, taking).components
        told += any(one.name in taking.scatter.names for one in components)
    assert told == 0
    assert min(pointed) > 1e-3


def test_a_nest_that_is_loose_stands_beside_the_scale_of_all() -> None:
    rng = np.random.default_rng(7)
    taking = taken(rng)
    noise = Noise(scale=1.5, scatter=(("nest 1", 1.6),))
    found = {one.name: one for one in estimate(read(taking, noise, rng), taking).components}
    assert set(found) == {"scale", "nest 1"}
    assert abs(found["scale"].value - 1.5) < 4.0 * found["scale"].sigma
    assert abs(found["nest 1"].value - 2.4) < 4.0 * found["nest 1"].sigma


@pytest.mark.parametrize(
    "noise",
    [
        Noise(scatter=(("nest 2", 1.6), ("along", 0.8)), scale=1.2),
        Noise(scatter=(("added", 4.0), ("across", 1.3)), tau_s=30.0),
        Noise(scatter=(("range", 1.0),), tau_s=30.0, share=0.5, visit=0.4),
    ],
    ids=str,
)
def test_whitened_columns_have_the_inner_products_of_the_inverse_covariance(noise: Noise) -> None:
    rng = np.random.default_rng(8)
    taking, some = taken(rng), np.arange(20)
    taking = Taking(
        taking.run[some], taking.time_s[some], taking.visit[some], taking.motions[:, :, some],
        scatter=Scatter(
            {name: own[some] for name, own in taking.scatter.groups.items()},
            taking.scatter.beam[:, some],
            {name: own[:, :, some] for name, own in taking.scatter.added.items()},
        ),
    )  # fmt: skip
    whole = dense(taking, noise)
    columns = rng.standard_normal((4, 3, some.size))
    whitening = Whitening(taking, noise)
    white, flat = whitening.apply(columns).reshape(4, -1), columns.reshape(4, -1)
    np.testing.assert_allclose(white @ white.T, flat @ np.linalg.solve(whole, flat.T), atol=1e-9)
    assert whitening.log_det == pytest.approx(np.linalg.slogdet(whole)[1], abs=1e-9)


def test_components_that_a_reading_does_not_hold_count_for_nothing() -> None:
    """Heights alone, their nests or the beam's direction scattering otherwise."""
    rng = np.random.default_rng(9)
    whole, noise = taken(rng), Noise(scatter=(("nest 2", 0.6), ("along", 1.8)), scale=1.1)
    live = np.ones((3, whole.run.size), dtype=bool)
    live[:2, whole.run.size // 2 :] = False
    some = replace(whole, live=live, motions=whole.motions * live)
    held = live.reshape(-1)
    covariance = dense(whole, noise)[np.ix_(held, held)]
    columns = rng.standard_normal((4, 3, whole.run.size)) * live
    whitening = Whitening(some, noise)
    white, flat = whitening.apply(columns).reshape(4, -1), columns.reshape(4, -1)[:, held]
    inner = flat @ np.linalg.solve(covariance, flat.T)
    np.testing.assert_allclose(white @ white.T, inner, atol=1e-8)
    assert whitening.log_det == pytest.approx(np.linalg.slogdet(covariance)[1], abs=1e-8)


def dense(taking: Taking, noise: Noise) -> np.ndarray:
    """The whole covariance (3 A, 3 A), written out from the components' own formulas."""
    count, own, sizes = taking.run.size, taking.scatter, dict(noise.scatter)
    alike = np.eye(count)
    if noise.tau_s:
        apart = np.abs(taking.time_s[:, None] - taking.time_s)
        alike = noise.share * np.exp(-apart / noise.tau_s) + (1.0 - noise.share) * alike
    whole = np.zeros((3, count, 3, count))
    roots = []
    for k in range(count):
        beam = np.outer(own.beam[:, k], own.beam[:, k])
        ratio = sizes.get("nest 2", 1.0) if own.groups["nest 2"][k] else 1.0
        one = sizes.get("along", 1.0) ** 2 * beam
        one = ratio**2 * (one + sizes.get("across", 1.0) ** 2 * (np.eye(3) - beam))
        for name in ("added", "range"):
            one = one + sizes.get(name, 0.0) ** 2 * own.added[name][:, :, k]
        roots.append(np.linalg.cholesky(one))
    for a in range(count):
        for b in range(count):
            whole[:, a, :, b] = noise.scale**2 * alike[a, b] * roots[a] @ roots[b].T
            if taking.visit[a] == taking.visit[b]:
                moved = taking.motions[:, :, a].T @ taking.motions[:, :, b]
                whole[:, a, :, b] += noise.visit**2 * moved
    return whole.reshape(3 * count, -1)
