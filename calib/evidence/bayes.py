"""How well each hypothesis explains the residual, fair between few and many unknowns.

A group of k unknowns always explains more than one. They are compared by Bayes factors against
"nothing is missing", with beta ~ N(0, (tau size)^2): in the eigenvectors of D V D (D the sizes,
eigenvalues v) the whitened scores a have variance 1 + tau^2 v under the hypothesis, so

    log B(tau) = sum_i  1/2 a_i^2 tau^2 v_i / (1 + tau^2 v_i) - 1/2 log(1 + tau^2 v_i).

Nobody knows the size to better than an order of magnitude: tau is averaged over 1/30..3. A
candidate's evidence is the mean of B over its trials (equal weights: each period that was tried
is paid for), half of it on the whole group and half shared by the subsets that may act alone.
Where even the best explanation leaves more than the stated noise, sigmas are taken larger by that
(``scores.noise``): another effect that is missing too must not decide between these.
"""

import numpy as np

from calib.arrays import Array, IntArray
from calib.evidence.scored import Scored
from calib.evidence.weighing import Spectrum, spectrum_of

TAUS = np.geomspace(1.0 / 30.0, 3.0, 7)
"""Multiples of the stated size over which the prior of an effect is averaged."""


def observed(scores: Scored, index: int) -> tuple[float, list[Array]]:
    """Log Bayes factor of a candidate in the observation, and its parts (T, 1)."""
    if index not in scores.remembered:
        found = scores.scores[index][:, :, :1] / scores.noise
        total, parts = log_evidence(scores, index, found)
        scores.remembered[index] = (float(total[0]), parts)
    return scores.remembered[index]


def log_evidence(scores: Scored, index: int, residual_scores: Array) -> tuple[Array, list[Array]]:
    """Log Bayes factor of a candidate against nothing missing.

    Parameters
    ----------
    scores : Scores
    index : int
        Which candidate.
    residual_scores : (T, k, D)
        Its unit columns times D residuals, in sigmas as they really are.

    Returns
    -------
    total : (D,)
    parts : list of (T, D)
        By hypothesis and trial, its share of the prior included.
    """
    candidate = scores.candidates[index]
    hypotheses = candidate.hypotheses
    shares = np.full(len(hypotheses), 0.5 / max(len(hypotheses) - 1, 1))
    shares[0] = 1.0 if len(hypotheses) == 1 else 0.5
    priors = np.log(shares / len(candidate.trials))
    found: dict[tuple[int, ...], Array] = {}
    for chosen in candidate.by_count:
        each = _by_trial(scores, index, chosen, residual_scores)
        for subset, one in zip(chosen, each, strict=True):
            found[tuple(map(int, subset))] = one
    parts = [prior + found[subset] for prior, subset in zip(priors, hypotheses, strict=True)]
    total = np.logaddexp.reduce(np.concatenate(parts), axis=0)
    return np.asarray(total), parts


def _by_trial(scores: Scored, index: int, chosen: IntArray, residual_scores: Array) -> Array:
    """Log Bayes factors (H, T, D) of hypotheses (H, k), averaged over tau."""
    spectrum = _spectrum(scores, index, chosen)
    values = np.maximum(spectrum.values, 0.0) / scores.noise**2
    size = spectrum.size / scores.noise
    picked = residual_scores[:, chosen].swapaxes(0, 1)
    rotated = np.swapaxes(spectrum.vectors, -1, -2) @ (size[..., None] * picked)
    grown = 1.0 + TAUS[:, None] ** 2 * values[..., None, :]
    gain = 0.5 * (TAUS[:, None] ** 2 / grown) @ rotated**2
    terms = gain - 0.5 * np.sum(np.log(grown), axis=-1)[..., None]
    top = terms.max(axis=2)
    return np.asarray(top + np.log(np.mean(np.exp(terms - top[:, :, None]), axis=2)))


def _spectrum(scores: Scored, index: int, chosen: IntArray) -> Spectrum:
    """Of hypotheses (H, k) at every trial, with the sizes that are usual."""
    if chosen.shape == (1, len(scores.candidates[index].unknowns)):
        whole = scores.weighed.spectrum(index)
        return Spectrum(whole.size[None], whole.values[None], whole.vectors[None])
    sizes = scores.norms[index] * scores.candidates[index].sizes
    weight = scores.weights[index][:, chosen[:, :, None], chosen[:, None, :]]
    return spectrum_of(weight.swapaxes(0, 1), sizes[:, chosen].swapaxes(0, 1))
