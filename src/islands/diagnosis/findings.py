"""Findings other than effects: gross errors, properties of the noise, a formula for the residual."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.resolution import is_unresolved, measure_resolution
from islands.diagnosis.gross_errors.explanation import GrossError
from islands.diagnosis.gross_errors.record_finding import FAMILY, RecordFinding
from islands.diagnosis.inference.confidence import CONFIDENCE_TEMPERATURE
from islands.diagnosis.inference.finding import Finding, Value
from islands.diagnosis.inference.noise_detectors import DETECTORS, QUANTISATION
from islands.diagnosis.inference.stepwise_search import MIN_GAIN
from islands.effects.interface.context import Signal, SimulationContext
from islands.records.noise_model import is_rounding_error
from islands.records.segments import count_runs


def describe_gross_errors(errors: Sequence[GrossError]) -> tuple[Finding, ...]:
    """Return the best gross error as a finding; the others of other names are its equivalents."""
    best = errors[0]
    odds = [float(np.exp((best.cost - each.cost) / (2 * CONFIDENCE_TEMPERATURE))) for each in errors]
    same = sum(odd for each, odd in zip(errors, odds, strict=True) if each.name == best.name)
    names = dict.fromkeys(each.name for each in errors if each.name != best.name)
    parameters = best.correction.parameters
    return (
        Finding(
            best.name,
            FAMILY,
            same / sum(odds),
            tuple(names),
            {name: Value(value, unit, None) for name, (value, unit) in parameters.items()},
            best.score,
            best.explained_fraction,
        ),
    )


def list_record_findings(errors: Sequence[GrossError]) -> tuple[RecordFinding, ...]:
    """Return the findings about a record with gross errors; those after the first one are alternatives."""
    best, *others = (each.finding for each in errors)
    return (best, *(replace(each, description=f"Or: {each.description}") for each in others))


def describe_noise(y: Signal, residual: Signal, context: SimulationContext) -> tuple[Finding, ...]:
    """Run the noise detectors in order, without those that an earlier finding excludes.

    Parameters
    ----------
    y, residual : ndarray, shape (samples,)
        Measured output and residual over the estimation part, NaN where the output is missing.
    """
    is_known = ~np.isnan(residual)
    if not is_known.all():
        runs = count_runs(is_known, context.segments)
        context = replace(context, u=context.u[: y.size][is_known], segments=runs)
        y, residual = y[is_known], residual[is_known]
    findings: list[Finding] = []
    if is_rounding_error(residual, y):
        return ()
    # Rounding errors are no noise, and have none of its other properties.
    is_rounding = is_unresolved(residual, measure_resolution(y))
    for detector in [QUANTISATION] if is_rounding else DETECTORS.values():
        if any(each.name in detector.excluded_by for each in findings):
            continue
        detection = detector.detect(y, residual, context)
        if detection is not None and detection.score_gain > MIN_GAIN:
            score = detection.score_gain
            values = {name: Value(value, unit, None) for name, (value, unit) in detection.parameters.items()}
            confidence = 1.0 / (1.0 + float(np.exp(-score / (2 * CONFIDENCE_TEMPERATURE))))
            findings.append(Finding(detector.name, detector.family, confidence, (), values, score, None))
    return tuple(findings)


@dataclass(frozen=True, slots=True)
class ResidualFormula:
    """A formula for the residual of the best simulation.

    Attributes
    ----------
    formula : str
        Formula of the residual, measured minus simulated output, in free run. Its regressors are past values
        of the residual, the input and the simulated output.
    explains : float
        Fraction of the residual's mean square that the formula predicts over the hold-out part.
    """

    formula: str
    explains: float
