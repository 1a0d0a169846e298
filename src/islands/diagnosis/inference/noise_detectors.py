"""Detectors of sampling and noise artefacts: quantisation, held samples, outliers, variance, colour."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from islands.diagnosis.calibration.variance_model import fit_variance_model
from islands.effects.interface.context import Signal, SimulationContext
from islands.records.channel_names import simplify_unit
from islands.records.noise_model import fit_noise
from islands.records.segments import find_bounds
from islands.rounding import NORMAL_MEDIAN


@dataclass(frozen=True, slots=True)
class NoiseFinding:
    """Result of a detector.

    Attributes
    ----------
    parameters : mapping
        Values by name, each with its unit.
    score_gain : float
        Decrease of minus twice the log-likelihood, less the BIC penalty.
    """

    parameters: Mapping[str, tuple[float, str]]
    score_gain: float


@dataclass(frozen=True, slots=True)
class NoiseDetector:
    """An entry of the catalogue that describes sampling or noise and does not change the simulation.

    Attributes
    ----------
    name : str
    summary : str
        One sentence with the form of the artefact, without a period.
    family : str
    detect : callable
        ``(y, residual, context) -> NoiseFinding or None``: the measured output and the residual of the best
        simulation, both over the estimation part; None if nothing is detected.
    source : str
        Publication that describes the artefact.
    excluded_by : tuple of str
        Earlier detectors whose artefacts have the same symptoms.
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


#: Minimum number of samples per distinct output value at which the values count as quantisation levels.
_MIN_SAMPLES_PER_LEVEL = 3.0

#: Minimum quantisation step that matters, in standard deviations of the residual.
_MIN_QUANTISATION_STEP = 0.5


def _detect_quantisation(y: Signal, residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    levels = np.unique(y)
    if levels.size < 3 or y.size < _MIN_SAMPLES_PER_LEVEL * levels.size:
        return None
    step = float(np.min(np.diff(levels)))
    multiples = (y - levels[0]) / step
    deviation = float(np.max(np.abs(multiples - np.round(multiples))))
    if deviation > 1e-3 or step < _MIN_QUANTISATION_STEP * float(np.std(residual)):
        return None
    return NoiseFinding({"step": (step, context.output_unit)}, float(y.size))


QUANTISATION = NoiseDetector(
    "quantisation",
    "The output is quantised to the resolution of the converter or the file",
    "data",
    _detect_quantisation,
    "Widrow and Kollar, Quantization Noise, section 1",
    similar_to="held-samples",
    distinguished_by="values lie on a lattice that is coarse compared with the residual",
)


#: Minimum number of equal successive samples in a burst.
_MIN_BURST_LENGTH = 3

#: Fraction of equal neighbours at a constant input above which a system without noise rests.
_MIN_SHARE_AT_REST = 0.5

#: Minimum number of bursts.
_MIN_BURSTS = 2


def _detect_held_samples(y: Signal, _residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    if y.size >= _MIN_SAMPLES_PER_LEVEL * np.unique(y).size:
        return None
    is_equal = np.diff(y) == 0.0
    is_equal[[first - 1 for first, _ in find_bounds(context.segments, y.size)[1:]]] = False
    is_resting_input = np.diff(context.u[: y.size]) == 0.0
    if is_resting_input.any() and np.mean(is_equal[is_resting_input]) > _MIN_SHARE_AT_REST:
        is_equal &= ~is_resting_input  # the system rests, and no sample is lost
    is_repeated = np.concatenate([[False], is_equal, [False]])
    edges = np.flatnonzero(np.diff(is_repeated.astype(np.int8)))
    lengths = edges[1::2] - edges[::2] + 1
    bursts = lengths[lengths >= _MIN_BURST_LENGTH]
    if bursts.size < _MIN_BURSTS:
        return None
    share = float(np.sum(bursts - 1)) / y.size
    return NoiseFinding(
        {"share": (share, ""), "longest": (float(bursts.max()) * context.dt, "s")},
        float(np.sum(bursts)) * float(np.log(y.size)),
    )


HELD_SAMPLES = NoiseDetector(
    "held-samples",
    "Bursts of repeated values: lost samples were replaced by the last received one",
    "data",
    _detect_held_samples,
    "Little and Rubin, Statistical Analysis with Missing Data",
    similar_to="quantisation",
    distinguished_by="equal neighbours in bursts, not everywhere",
)


#: Distance beyond which a sample is an outlier, in robust standard deviations.
_OUTLIER_DISTANCE = 5.5

#: Minimum number of outliers.
_MIN_OUTLIERS = 3


def _whiten(y: Signal, residual: Signal, context: SimulationContext) -> tuple[Signal, Signal]:
    """Return the whitened residual, and the simulated output at the same samples.

    The first samples of recordings after the first one are left out: the filter starts at rest, so that they
    are not innovations. Those of a single recording are too few to matter.
    """
    noise = fit_noise(residual, segments=context.segments)
    is_innovation = np.ones(residual.size, dtype=bool)
    for first, _ in find_bounds(context.segments, residual.size)[1:]:
        is_innovation[first : first + noise.order] = False
    return noise.whiten(residual, context.segments)[is_innovation], (y - residual)[is_innovation]


def _detect_outliers(y: Signal, residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    whitened, output = _whiten(y, residual, context)
    # Noise that is large at times is no series of outliers.
    scale = fit_variance_model(whitened, output).scale
    standardised = whitened / scale
    robust = float(np.median(np.abs(standardised - np.median(standardised)))) / NORMAL_MEDIAN
    if robust == 0.0:
        return None
    is_outlier = np.abs(standardised) > _OUTLIER_DISTANCE * robust
    count = int(np.count_nonzero(is_outlier))
    n = whitened.size
    # If most residuals are far from 0, the simulation is biased, and they are no single samples.
    if not _MIN_OUTLIERS <= count < n / 2:
        return None
    decrease = n * float(np.log(np.mean(standardised**2) / np.mean(standardised[~is_outlier] ** 2)))
    score_gain = decrease - 2 * count * float(np.log(n))
    size = float(np.median(np.abs(whitened[is_outlier])))
    return NoiseFinding({"share": (count / n, ""), "size": (size, context.output_unit)}, score_gain)


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


def _detect_heteroscedastic_noise(
    y: Signal, residual: Signal, context: SimulationContext
) -> NoiseFinding | None:
    whitened, output = _whiten(y, residual, context)
    found = fit_variance_model(whitened, output)
    if found.strength_gain <= 0.0:
        return None
    strength = found.strength / float(np.max(np.abs(output)))
    return NoiseFinding({"k": (strength, simplify_unit(f"1/{context.output_unit}"))}, found.strength_gain)


HETEROSCEDASTIC_NOISE = NoiseDetector(
    "heteroscedastic-noise",
    "Noise that grows with the output: sigma (1 + k |y|)",
    "data",
    _detect_heteroscedastic_noise,
    "Davidian and Carroll, Variance function estimation, 1987",
    ("held-samples",),
    similar_to="outliers, changing-noise",
    distinguished_by="the size of the residual over that of the output",
)


def _detect_changing_noise(y: Signal, residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    found = fit_variance_model(*_whiten(y, residual, context))
    if found.levels_gain <= 0.0:
        return None
    ratio = float(np.max(found.levels) / np.min(found.levels))
    return NoiseFinding({"ratio": (ratio, "")}, found.levels_gain)


CHANGING_NOISE = NoiseDetector(
    "changing-noise",
    "Noise that is larger in some parts of the record than in others",
    "data",
    _detect_changing_noise,
    "Priestley, Evolutionary spectra and non-stationary processes, 1965",
    ("held-samples",),
    similar_to="heteroscedastic-noise, outliers",
    distinguished_by="the size of the residual over time; the ratio is that of the largest to the smallest",
)


def _detect_coloured_noise(_y: Signal, residual: Signal, context: SimulationContext) -> NoiseFinding | None:
    noise = fit_noise(residual, segments=context.segments)
    if noise.order == 0:
        return None
    white = residual.size * float(np.log(np.mean(residual**2)))
    score_gain = white - noise.minus_twice_log_likelihood
    return NoiseFinding(
        {
            "pole": (noise.largest_pole, ""),
            "order": (float(noise.coefficients.size), ""),
            "difference order": (noise.difference_order, ""),
        },
        score_gain,
    )


COLOURED_NOISE = NoiseDetector(
    "coloured-noise",
    "Coloured noise in the residual of the best simulation",
    "data",
    _detect_coloured_noise,
    "Ljung, System Identification, 2nd ed., section 4",
    ("held-samples",),
    similar_to="exponential-creep, linear-drift",
    distinguished_by="autocorrelation of the residual of the best simulation",
)


#: Detectors by name, in the order in which they run.
DETECTORS: Mapping[str, NoiseDetector] = {
    detector.name: detector
    for detector in (
        QUANTISATION,
        HELD_SAMPLES,
        OUTLIERS,
        HETEROSCEDASTIC_NOISE,
        CHANGING_NOISE,
        COLOURED_NOISE,
    )
}
