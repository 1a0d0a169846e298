"""Exchange of estimation part and hold-out part: an extension that is fitted to other recordings.

A cause that is right has the same values in all recordings of a system, and an extension that is fitted to
one of them reduces the error of the others (two-fold cross-validation: Stone, Cross-validatory choice and
assessment of statistical predictions, 1974). A wrong law has other values for another input.
"""

from dataclasses import dataclass, replace

import numpy as np

from islands.diagnosis.calibration.initial_states import fit_initial_states
from islands.diagnosis.calibration.levenberg_marquardt import (
    CalibrationResult,
    calibrate,
    estimate_deviations,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.extension_trial import find_added_parameters
from islands.diagnosis.inference.holdout import HoldoutGain, measure_gain
from islands.diagnosis.inference.verdict import choose_reference_fit
from islands.records.dataset import Dataset

#: Difference of two values in standard deviations above which they contradict each other.
MAX_DISTANCE = 4.0

#: Difference relative to the larger value that is none: laws are idealisations.
NEGLIGIBLE_DIFFERENCE = 0.1


@dataclass(frozen=True, slots=True)
class ExchangedValue:
    """A parameter of an extension in two fits of it.

    Attributes
    ----------
    name, unit : str
        Name with that of its effect; terms have the names of their parameters.
    estimation, validation : float
        Value from the estimation part, and from the hold-out part.
    deviations : tuple of float
        Standard deviations of both.
    """

    name: str
    unit: str
    estimation: float
    validation: float
    deviations: tuple[float, float]

    @property
    def agrees(self) -> bool:
        """Whether both values may be the same."""
        difference = abs(self.estimation - self.validation)
        size = max(abs(self.estimation), abs(self.validation))
        return difference <= max(
            MAX_DISTANCE * float(np.hypot(*self.deviations)), NEGLIGIBLE_DIFFERENCE * size
        )


@dataclass(frozen=True, slots=True)
class ExchangedParts:
    """An extension that is fitted to the hold-out part.

    Attributes
    ----------
    gain : HoldoutGain or None
        Errors over the estimation part, which was not fitted; None if a simulation diverges there.
    values : tuple of ExchangedValue
        Parameters of the effects and terms.
    """

    gain: HoldoutGain | None
    values: tuple[ExchangedValue, ...]


def exchange_parts(
    record: Dataset,
    base: CalibrationResult,
    best: CalibrationResult,
    target: Target,
    floor: float,
    rng: np.random.Generator,
) -> ExchangedParts | None:
    """Fit a simulation and its extension to the hold-out recordings, and measure the gain on the others.

    Parameters
    ----------
    record : Dataset
    base, best : CalibrationResult
        The simulation without the extension, and with it.
    target : Target
    floor : float
        RMSE of noise alone.
    rng : Generator

    Returns
    -------
    ExchangedParts or None
        None if the hold-out part is the end of a recording: it is too short, and not another input.
    """
    if not record.held_out:
        return None
    is_held_out = ~np.isnan(target.y) & (np.arange(target.y.size) >= target.fitted)
    exchanged = replace(target, noise=None, estimation_part=is_held_out)
    fits = [calibrate(each.simulation, exchanged, each.values) for each in (base, best)]
    has_terms = best.simulation.simulator_slice != base.simulation.simulator_slice
    effects = best.simulation.effects
    reference = fits[0] if has_terms else choose_reference_fit(effects, fits[0], exchanged)
    before, after = (
        fit_initial_states(each, target, 0, target.fitted).output for each in (reference, fits[1])
    )
    is_finite = bool(np.isfinite([before, after]).all())
    gain = measure_gain(record, before, after, slice(0, target.fitted), floor, rng) if is_finite else None
    deviations = estimate_deviations(best, target), estimate_deviations(fits[1], exchanged)
    values = tuple(
        ExchangedValue(
            name,
            best.simulation.parameters[place].unit,
            estimation=float(best.values[place]),
            validation=float(fits[1].values[place]),
            deviations=(float(deviations[0][place]), float(deviations[1][place])),
        )
        for place, name in find_added_parameters(base, best).items()
    )
    return ExchangedParts(gain, values)
