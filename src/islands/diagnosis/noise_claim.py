"""Claim that a residual is noise: what decides it, and what the user has to judge."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    estimate_deviations,
    whiten_target,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.confidence_limits import limit_confidences
from islands.diagnosis.discovery.state_equations import get_linear
from islands.diagnosis.gross_errors.closed_loop import find_closed_loop
from islands.diagnosis.gross_errors.record_finding import RecordFinding
from islands.diagnosis.inference.finding import Value
from islands.diagnosis.inference.hidden_structure import find_hidden_structure
from islands.diagnosis.inference.noise_detectors import COLOURED_NOISE
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import CalibratedValue, Diagnosis, NoiseClaim
from islands.effects.interface.context import Signal


def list_calibrated_values(found: Diagnosis, target: Target) -> tuple[CalibratedValue, ...]:
    """Return the values of the best simulation of a diagnosis, without those of its terms and initial states.

    Parameters
    ----------
    found : Diagnosis
    target : Target
        The record that it explains.

    Returns
    -------
    tuple of CalibratedValue
        Without intervals if the residual is a rounding error.
    """
    fit, base = found.best, found.base
    simulation, part = fit.simulation, fit.simulation.simulator_slice
    parameters = simulation.parameters[part]
    if not parameters:
        return ()
    is_exact = target.is_matched(fit.output)
    deviations = None if is_exact else estimate_deviations(fit, whiten_target(target, fit))
    is_replaced = get_linear(base) is not None and get_linear(fit) is None
    if is_replaced:  # The nominal values of the equations are those of the calibrated linear simulation.
        alone = {each.name: each.nominal for each in parameters}
    else:
        known = base.simulation.simulator_slice
        names = [each.name for each in base.simulation.parameters[known]]
        alone = dict(zip(names, base.values[known].tolist(), strict=True))
    terms = {name for each in found.causes if each.term for name in each.parameters}
    values = []
    for place, parameter in enumerate(parameters, part.start):
        if parameter.initial or parameter.name in terms:
            continue
        value, unit = float(fit.values[place]), parameter.unit
        estimate = (
            Value(value, unit, None)
            if deviations is None
            else Value.estimate(value, unit, float(deviations[place]))
        )
        before = None if is_replaced else parameter.nominal
        values.append(CalibratedValue(parameter.name, before, alone.get(parameter.name), estimate))
    return tuple(values)


#: Ratio of the residual to the stated noise of the sensor above which the residual is no noise of the sensor.
#: Data sheets and estimates from a resting output are seldom wrong by a factor of two.
MAX_NOISE_RATIO = 2.0

#: Number of parts of a record whose residuals are compared.
PARTS = 8

#: Ratio of the largest to the smallest residual of these parts from which the residual has a place in time.
MIN_PART_RATIO = 2.0

#: Autocorrelation at the correlation time.
CORRELATION = float(np.exp(-1.0))


def complete_findings(
    found: Diagnosis,
    fit: CalibrationResult,
    target: Target,
    record_findings: Sequence[RecordFinding],
    noise_level: float | None,
    rng: np.random.Generator,
) -> Diagnosis:
    """Return a diagnosis with all findings about its record, its values, and the claim about its residual.

    Parameters
    ----------
    found : Diagnosis
    fit : CalibrationResult
        Simulation whose residual shows a closed loop.
    target : Target
    record_findings : sequence of RecordFinding
        Findings from before the search.
    noise_level, rng
        As for `judge_noise`.
    """
    closed_loop = find_closed_loop(fit, target, found.record.input_names[0])
    found = limit_confidences(judge_noise(found, target, noise_level, rng), target)
    return replace(
        found,
        values=list_calibrated_values(found, target),
        record_findings=(*record_findings, *closed_loop, *found.record_findings),
    )


def judge_noise(
    found: Diagnosis, target: Target, noise_level: float | None, rng: np.random.Generator
) -> Diagnosis:
    """Return a diagnosis without a cause whose verdict says what is known about the residual.

    It remains "nothing" if the residual is below the resolution of the output, if it is white, if its
    correlation time is that of one sample, or if it is as small as the noise that the user states. A residual
    far above that noise, and a coloured one that depends on the input, are "unknown". A coloured residual for
    which nothing decides is "noise".

    Parameters
    ----------
    found : Diagnosis
        Diagnosis whose verdict is "nothing"; others are returned with the claim alone.
    noise_level : float or None
        Standard deviation of the noise of the output, in its unit, that the user knows.
    """
    residual = (target.y - found.best.output)[target.estimation_part]
    claim = _describe_residual(residual, found, target, noise_level)
    found = replace(found, noise_claim=claim)
    if found.verdict != Verdict.NOTHING or target.is_matched(found.best.output):
        return found
    is_far = noise_level is not None and claim.rms > MAX_NOISE_RATIO * noise_level
    if not (is_far or claim.correlation_time):
        return found
    structure = find_hidden_structure(found.best, target, rng)
    if structure or is_far:
        findings = (*found.record_findings, *([_describe_far_residual(found, residual)] if is_far else ()))
        return replace(
            found,
            verdict=Verdict.UNKNOWN,
            effects=(),
            residual_structure={**found.residual_structure, **structure},
            record_findings=findings,
        )
    is_slow = claim.correlation_time > found.record.dt
    return replace(found, verdict=Verdict.NOISE) if is_slow and noise_level is None else found


def _describe_residual(
    residual: Signal, found: Diagnosis, target: Target, noise_level: float | None
) -> NoiseClaim:
    """Return size and correlation time of a residual; white noise has a correlation time of zero."""
    context = replace(found.best.simulation.context, segments=target.fitted_segments)
    # White noise has an autoregression by chance; the gain that makes it a finding is rarer.
    detection = COLOURED_NOISE.detect(target.y[target.estimation_part], residual, context)
    is_coloured = detection is not None and detection.score_gain > MIN_GAIN
    correlation_time = _find_correlation_time(residual) * context.dt if is_coloured else 0.0
    return NoiseClaim(float(np.sqrt(np.mean(residual**2))), correlation_time, noise_level)


def _find_correlation_time(residual: Signal) -> float:
    """Return the lag at which the autocorrelation has fallen to 1/e, in samples; at least one."""
    centred = residual - residual.mean()
    products = np.fft.irfft(np.abs(np.fft.rfft(centred, 2 * centred.size)) ** 2)[: centred.size]
    below = np.flatnonzero(products < CORRELATION * products[0])
    return float(max(int(below[0]) if below.size else centred.size, 1))


def _describe_far_residual(found: Diagnosis, residual: Signal) -> RecordFinding:
    """Return the finding that a residual is no noise of the sensor, with its places in frequency and time."""
    claim = found.noise_claim
    assert claim is not None
    assert claim.noise_level is not None
    unit = f" {found.record.output_unit}".rstrip()
    ratio = claim.rms / claim.noise_level
    return RecordFinding(
        "above-noise-level",
        f"The residual has an RMS of {claim.rms:.3g}{unit}, {ratio:.1f} times the stated noise of "
        f"{claim.noise_level:.3g}{unit}: it is no noise of the sensor. {_locate(residual, found.record.dt)}",
        "Record what else acts on the system as a channel, take a simulation of a higher order, or correct "
        "the noise level.",
        {"rms": (claim.rms, found.record.output_unit), "ratio": (ratio, "")},
    )


def _locate(residual: Signal, dt: float) -> str:
    """State in which frequencies and in which part of the record most of a residual is."""
    power = np.abs(np.fft.rfft(residual - residual.mean())) ** 2
    half = int(np.searchsorted(np.cumsum(power), 0.5 * power.sum()))
    frequency = half / (residual.size * dt)
    text = f"Half of its energy is below {frequency:.2g} Hz"
    parts = [float(np.sqrt(np.mean(part**2))) for part in np.array_split(residual, PARTS)]
    largest = int(np.argmax(parts))
    if parts[largest] < MIN_PART_RATIO * min(parts):
        return f"{text}, and it is equally large in all parts of the record."
    edges = np.linspace(0.0, residual.size * dt, PARTS + 1)
    return f"{text}, and it is largest from {edges[largest]:.3g} to {edges[largest + 1]:.3g} s."
