"""Detectors of what sampling and noise do to a record: quantisation, outliers, coloured noise, and others."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from islands.discrepancy.calibration.noise_model import fit_ar_noise
from islands.discrepancy.interfaces.effect import Signal, SimulationContext


@dataclass(frozen=True, slots=True)
class NoiseFinding:
    """What a detector has found.

    Attributes
    ----------
    parameters : mapping
        Values by name, each with its unit.
    score_gain : float
        Minus twice the log-likelihood that naming it is worth, paid for as BIC does.
    """

    parameters: Mapping[str, tuple[float, str]]
    score_gain: float


@dataclass(frozen=True, slots=True)
class NoiseDetector:
    """An entry of the catalogue that changes no simulation.

    Attributes
    ----------
    name : str
    summary : str
        What it is, in one sentence.
    family : str
    detect : callable
        ``(y, residual, scene) -> Detection or None``: the measured output and what the best simulation leaves
        of it, both over the fitted samples.
    source : str
    excluded_by : tuple of str
        Detectors before it that leave the same traces.
    similar_to, distinguished_by : str
        As in `Effect`.
    """

    name: str
    summary: str
    family: str
    detect: Callable[[Signal, Signal, SimulationContext], NoiseFinding | None]
    source: str
    excluded_by: tuple[str, ...] = ()
    similar_to: str = ""
    distinguished_by: str = ""


#: Samples for each level from which on the levels are a lattice.
_CROWDED = 3.0

#: Median absolute deviation of normal noise in standard deviations.
_MAD = 0.6745

#: Least step of a lattice that matters, relative to the standard deviation of the residual.
_QUANTISATION_COARSE = 0.5


def _detect_quantisation(y: Signal, residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    levels = np.unique(y)
    if levels.size < 3 or y.size < _CROWDED * levels.size:
        return None
    step = float(np.min(np.diff(levels)))
    places = (y - levels[0]) / step
    off = float(np.max(np.abs(places - np.round(places))))
    if off > 1e-3 or step < _QUANTISATION_COARSE * float(np.std(residual)):
        return None
    return NoiseFinding({"step": (step, context.output_unit)}, float(y.size))


QUANTISATION = NoiseDetector(
    "quantisation",
    "The output lies on a lattice: the converter's or the file's resolution",
    "data",
    _detect_quantisation,
    "Widrow and Kollar, Quantization Noise, section 1",
    similar_to="held-samples",
    distinguished_by="values lie on a lattice that is coarse compared with the residual",
)


#: Equal neighbours that make a burst, and bursts that are no chance.
_HELD_SAMPLES_RUN, _HELD_SAMPLES_BURSTS = 3, 2


def _detect_held_samples(y: Signal, _residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    if y.size >= _CROWDED * np.unique(y).size:
        return None
    same = np.concatenate([[False], np.diff(y) == 0.0, [False]])
    edges = np.flatnonzero(np.diff(same.astype(np.int8)))
    lengths = edges[1::2] - edges[::2] + 1
    bursts = lengths[lengths >= _HELD_SAMPLES_RUN]
    if bursts.size < _HELD_SAMPLES_BURSTS:
        return None
    share = float(np.sum(bursts - 1)) / y.size
    return NoiseFinding(
        {"share": (share, ""), "longest": (float(bursts.max()) * context.dt, "s")},
        float(np.sum(bursts)) * float(np.log(y.size)),
    )


HELD_SAMPLES = NoiseDetector(
    "held-samples",
    "Bursts of repeated values: samples that were lost, and the last one sent again",
    "data",
    _detect_held_samples,
    "Little and Rubin, Statistical Analysis with Missing Data",
    similar_to="quantisation",
    distinguished_by="equal neighbours in bursts, not everywhere",
)


#: Scaled median deviations beyond which a sample is none of the others, and the least number of them.
_OUTLIERS_FAR, _OUTLIERS_LEAST = 5.5, 3


def _detect_outliers(_y: Signal, residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    left = fit_ar_noise(residual).whiten(residual)
    scale = float(np.median(np.abs(left - np.median(left)))) / _MAD
    if scale == 0.0:
        return None
    far = np.abs(left) / scale
    count = int(np.count_nonzero(far > _OUTLIERS_FAR))
    if count < _OUTLIERS_LEAST:
        return None
    usual = left[far <= _OUTLIERS_FAR]
    n = left.size
    gained = n * float(np.log(np.mean(left**2)) - np.log(np.mean(usual**2))) - 2 * count * float(np.log(n))
    size = float(np.median(np.abs(left[far > _OUTLIERS_FAR])))
    return NoiseFinding({"share": (count / n, ""), "size": (size, context.output_unit)}, gained)


OUTLIERS = NoiseDetector(
    "outliers",
    "Single samples far from their neighbours' errors",
    "data",
    _detect_outliers,
    "Hampel, The influence curve and its role in robust estimation, 1974",
    ("held-samples",),
    similar_to="heteroscedastic-noise",
    distinguished_by="single samples beyond 5.5 scaled median deviations",
)


#: Strengths that are tried, relative to the largest output.
_HETEROSCEDASTIC_NOISE_STRENGTHS = np.concatenate([[0.0], np.geomspace(0.1, 30.0, 60)])


def _detect_heteroscedastic_noise(
    y: Signal, residual: Signal, context: SimulationContext
) -> NoiseFinding | None:
    noise = fit_ar_noise(residual)
    left = noise.whiten(residual)
    size = np.abs(y) / np.max(np.abs(y))
    n = left.size
    # A few outliers at large outputs look the same: squares are limited to four deviations.
    scale = float(np.median(np.abs(left))) / _MAD
    if scale == 0.0:  # most of it is no noise at all
        return None
    squares = np.minimum(left**2, (4 * scale * (1.0 + size)) ** 2)
    costs = [
        n * float(np.log(np.mean(squares / (1.0 + k * size) ** 2))) + 2 * float(np.sum(np.log1p(k * size)))
        for k in _HETEROSCEDASTIC_NOISE_STRENGTHS
    ]
    best = int(np.argmin(costs))
    gained = costs[0] - costs[best] - float(np.log(n))
    if gained <= 0.0:
        return None
    strength = float(_HETEROSCEDASTIC_NOISE_STRENGTHS[best]) / float(np.max(np.abs(y)))
    return NoiseFinding({"k": (strength, f"1/{context.output_unit}")}, gained)


HETEROSCEDASTIC_NOISE = NoiseDetector(
    "heteroscedastic-noise",
    "Noise that grows with the output: sigma (1 + k |y|)",
    "data",
    _detect_heteroscedastic_noise,
    "Davidian and Carroll, Variance function estimation, 1987",
    ("held-samples", "outliers"),
    similar_to="outliers",
    distinguished_by="the size of the residual over that of the output",
)


def _detect_coloured_noise(_y: Signal, residual: Signal, _scene: SimulationContext) -> NoiseFinding | None:
    noise = fit_ar_noise(residual)
    if noise.order == 0:
        return None
    white = residual.size * float(np.log(np.mean(residual**2)))
    gained = white - noise.minus_twice_log_likelihood
    pole = float(np.max(np.abs(np.roots(np.concatenate([[1.0], -noise.coefficients])))))
    return NoiseFinding({"pole": (pole, ""), "order": (float(noise.order), "")}, gained)


COLOURED_NOISE = NoiseDetector(
    "coloured-noise",
    "Noise that remembers, where the best simulation leaves nothing else",
    "data",
    _detect_coloured_noise,
    "Ljung, System Identification, 2nd ed., section 4",
    ("held-samples",),
    similar_to="exponential-creep, linear-drift",
    distinguished_by="autocorrelation of the residual of the best simulation",
)


#: Detectors by name, in the order in which they are tried.
DETECTORS: Mapping[str, NoiseDetector] = {
    detector.name: detector
    for detector in (QUANTISATION, HELD_SAMPLES, OUTLIERS, HETEROSCEDASTIC_NOISE, COLOURED_NOISE)
}
