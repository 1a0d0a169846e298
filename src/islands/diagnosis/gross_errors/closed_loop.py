"""Test for data from a closed loop: whether the input depends on earlier errors of the simulation.

Without feedback, the noise of the output is independent of the input. Residual and input are both whitened,
and their cross-correlations are compared with those of circular shifts (Haugh, Checking the independence of
two covariance-stationary time series, 1976). Feedback correlates the residual with later inputs. An error of
the simulation correlates it with earlier ones, so that correlations with later inputs have to predominate.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.gross_errors.record_finding import RecordFinding
from islands.effects.interface.context import Signal

#: What is done about feedback within a sample, and what else the user can do about it.
WITHIN_A_SAMPLE = (
    "The input has the noise of the same row: a direct term of a linear simulation (b0) would be fitted to "
    "that noise and is held at zero, and effects and terms that act at once are left out."
)
OTHER_INPUT = (
    "Or simulate the closed loop, with its setpoint as the input. If the plant itself responds at once, its "
    "direct term has a biased estimate from this record: sample faster, or record without the controller."
)

#: Size of the pulse with which the response of a simulation is tested, relative to the largest input.
PULSE = 0.01

#: Largest response at the sample of a pulse, relative to the largest one, without direct feedthrough.
MAX_DIRECT_RESPONSE = 0.1

#: Order of the autoregressions that whiten residual and input.
ORDER = 20

#: Number of lags on each side, in samples.
LAGS = 10

#: Size of an innovation of the input, in medians, at which it is also clipped: a few steps of a setpoint are
#: much larger than the noise that is fed back.
LARGE_INNOVATION = 3.0

#: Distance from the null distribution above which feedback is reported, in standard deviations.
MIN_DISTANCE = 4.0

#: The same if the residual also contradicts a direct term; of 40 simulated loops, one is below the other one.
MIN_DISTANCE_WITHIN_A_SAMPLE = 3.0

#: Least ratio of the squared correlations with later inputs to those with earlier ones.
MIN_RATIO = 2.0

#: Least number of samples, and of circular shifts that give the null distribution.
MIN_SAMPLES = 10 * ORDER

#: Circular shifts below this number of samples are not part of the null distribution.
MIN_SHIFT = 4 * LAGS


def find_closed_loop(fit: CalibrationResult, target: Target, input_name: str) -> tuple[RecordFinding, ...]:
    """Return a finding if the input depends on earlier errors of a simulation; otherwise nothing.

    Parameters
    ----------
    fit : CalibrationResult
        The best simulation. Errors below the resolution of the output are rounding, and no noise.
    """
    if target.is_matched(fit.output):
        return ()
    u, residual = fit.simulation.context.u[: target.fitted], (target.y - fit.output)[: target.fitted]
    residual = np.where(np.isnan(residual), np.nanmean(residual), residual)
    # Feedback within a sample and a simulation that responds at once are alike.
    first = 1 if acts_at_once(fit) else 0
    least = MIN_DISTANCE_WITHIN_A_SAMPLE if target.has_feedback else MIN_DISTANCE
    feedback = measure_feedback(u, residual, first, least)
    if feedback is None:
        return ()
    lag, correlation, distance = feedback
    held = f" {WITHIN_A_SAMPLE}" if target.has_feedback else ""
    source = f" {OTHER_INPUT}" if target.has_feedback else ""
    return (
        RecordFinding(
            "closed-loop",
            f"The input {input_name} depends on earlier errors of the output, as that of a controller does: "
            f"the correlation of the whitened residual with the input {lag} samples later is "
            f"{correlation:.2g}, {distance:.1f} standard deviations beyond chance. In a closed loop the "
            "input contains the noise: estimated parameters are biased unless the noise model is right, and "
            f"effects that act through the input are less certain.{held}",
            "Give known parameters with their tolerances (option tolerance) instead of estimating them, and "
            f"change the setpoint during the test, or use a record without the controller.{source}",
            {"correlation": (correlation, ""), "lag": (float(lag), "samples")},
        ),
    )


def measure_feedback(
    u: Signal, residual: Signal, first: int, least: float = MIN_DISTANCE
) -> tuple[int, float, float] | None:
    """Return lag and size of the largest correlation with later inputs, and its distance from chance.

    Parameters
    ----------
    u, residual : ndarray, shape (samples,)
        Input and residual.
    first : int
        First of the `LAGS` lags that belong to feedback, 0 or 1.
    least : float
        Least distance from the null distribution, in standard deviations.

    Returns
    -------
    tuple or None
        None without significant feedback.
    """
    if u.size < MIN_SAMPLES or np.ptp(u) == 0.0 or np.ptp(residual) == 0.0:
        return None
    errors, inputs = whiten(residual), whiten(u)
    limit = LARGE_INNOVATION * float(np.median(np.abs(inputs)))
    found = (_correlate(errors, each, first, least) for each in (inputs, np.clip(inputs, -limit, limit)))
    return next((each for each in found if each is not None), None)


def _correlate(errors: Signal, inputs: Signal, first: int, least: float) -> tuple[int, float, float] | None:
    """Return the feedback that `measure_feedback` returns, from innovations of residual and input."""
    spectrum = np.conj(np.fft.rfft(errors)) * np.fft.rfft(inputs)
    size = float(np.sqrt((errors @ errors) * (inputs @ inputs)))
    if size == 0.0:
        return None
    # Element j is the correlation of a residual with the input j samples later.
    correlation = np.fft.irfft(spectrum, errors.size) / size
    squares = np.convolve(np.concatenate([correlation, correlation[: LAGS - 1]]) ** 2, np.ones(LAGS), "valid")
    later, earlier = float(squares[first]), float(squares[first - LAGS])
    null = np.log(squares[MIN_SHIFT : -MIN_SHIFT - LAGS])
    distance = (float(np.log(later)) - float(null.mean())) / float(null.std())
    if distance < least or later < MIN_RATIO * earlier:
        return None
    lag = first + int(np.argmax(np.abs(correlation[first : first + LAGS])))
    return lag, float(correlation[lag]), distance


def acts_at_once(fit: CalibrationResult, least: float = MAX_DIRECT_RESPONSE) -> bool:
    """Return whether the simulated output responds to the input of the same sample.

    Parameters
    ----------
    least : float
        Response at the sample of a pulse, relative to the largest one, from which it does. A response below a
        tenth is that of the interpolation between samples.
    """
    context = fit.simulation.context
    middle = context.u.size // 2
    u = context.u.copy()
    u[middle] += PULSE * context.input_peak
    simulation = replace(fit.simulation, context=replace(context, u=u))
    response = np.abs(simulation.simulate(fit.values) - fit.output)
    return not response[middle] < least * np.max(response)


def whiten(signal: Signal) -> NDArray[np.float64]:
    """Return the innovations of a signal under an autoregression; the first `ORDER` samples are left out."""
    centred = signal - signal.mean()
    lagged = np.column_stack([centred[ORDER - lag : centred.size - lag] for lag in range(1, ORDER + 1)])
    later = centred[ORDER:]
    return np.asarray(later - lagged @ np.linalg.lstsq(lagged, later, rcond=None)[0])
