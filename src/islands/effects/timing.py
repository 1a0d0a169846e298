"""Effects on time: delay, constant or not, clock skew, rate limit, lags and resonance of the sensor."""

from dataclasses import replace

import numpy as np

from islands.effects.filters import low_pass
from islands.effects.interface.context import (
    Parameter,
    Points,
    Signal,
    SimulationContext,
    find_single_frequency,
)
from islands.effects.interface.effect import Effect, Formula, MapEquation, Site
from islands.kernels.lagrange import interpolate_at
from islands.kernels.linear_filter import filter_linearly
from islands.kernels.memory_operators import lag_by_gap, limit_rate

#: Largest negative delay in samples. An output that is sampled after the step of the input is a sample early.
_LONGEST_LEAD = 1.2


def _delay_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "tau",
            "s",
            0.0,
            context.dt,
            -_LONGEST_LEAD * context.dt,
            min(30 * context.dt, context.fit_end_time / 4),
        ),
    )


DELAY = Effect(
    name="delay",
    title="delay of the input",
    summary="The input acts later than it is recorded, or earlier if tau is negative: u(t - tau)",
    family="timing",
    site=Site.INPUT,
    parameters=_delay_parameters,
    starting_points=lambda context, _: ((0.5 * context.dt,), (2 * context.dt,), (6 * context.dt,)),
    form=lambda u, values, context: interpolate_at(u, np.arange(u.size) - values[0] / context.dt),
    equation=lambda _: MapEquation("z0", (("interpolate", "0", "n0", "0", "0", "0"),)),
    formula=Formula("at(x, t - tau)"),
    source="Ljung, System Identification, 2nd ed., section 16",
    similar_to="sensor-lag, resonance, viscous",
    distinguished_by="the phase grows with the frequency at constant amplitude; hysteresis is delayed too",
    occurs_in="transport of material, sampling and communication of a controller, filters of the data logger",
)

#: Fewest and most periods of a delay that swings, in the estimation part.
_FEWEST_SWINGS, _MOST_SWINGS = 0.5, 20.0

#: Step of the numbers of periods from which the calibration starts.
_SWING_STEP = 0.25

#: Means of a delay that swings from which the calibration starts, relative to the amplitude.
_SWING_MEANS = (0.0, 1.0, 2.0)


def _varying_delay_form(u: Signal, values: Signal, context: SimulationContext) -> Signal:
    mean, cosine, sine, frequency = values
    angle = 2 * np.pi * frequency * context.time
    late = mean + cosine * np.cos(angle) + sine * np.sin(angle)
    return interpolate_at(u, np.arange(u.size) - late / context.dt)


def _varying_delay_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    (mean,) = _delay_parameters(context)
    most, duration = mean.upper, context.fit_end_time
    return (
        replace(mean, name="mean"),
        Parameter("cosine", "s", 0.0, context.dt, -most, most),
        Parameter("sine", "s", 0.0, context.dt, -most, most),
        Parameter(
            "frequency", "Hz", 0.0, 0.1 / duration, _FEWEST_SWINGS / duration, 2 * _MOST_SWINGS / duration
        ),
    )


def _varying_delay_starting_points(context: SimulationContext, residual: Signal) -> Points:
    """Return starting points with the frequency at which the residual follows the rate of the output most.

    The residual is that rate times minus the delay, as far as the delay is short for the output.
    """
    fitted = round(context.fit_end_time / context.dt)
    assert context.measured is not None
    simulated = context.measured[:fitted] - residual[:fitted]
    size = float(np.max(np.abs(simulated))) or 1.0
    simulated, residual = simulated / size, residual[:fitted] / size
    rate = np.gradient(simulated, context.dt)
    absorbed, _ = np.linalg.qr(np.column_stack([np.ones(fitted), simulated, rate]))
    residual = residual - absorbed @ (absorbed.T @ residual)
    swings = np.arange(_FEWEST_SWINGS, _MOST_SWINGS, _SWING_STEP)
    angles = 2 * np.pi * np.outer(np.arange(fitted) / fitted, swings)
    columns = -rate[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], axis=2)
    columns -= np.tensordot(absorbed, np.tensordot(absorbed, columns, (0, 0)), (1, 0))
    products = np.einsum("tsi,t->si", columns, residual)
    weights = (np.linalg.pinv(np.einsum("tsi,tsj->sij", columns, columns)) @ products[:, :, None])[:, :, 0]
    place = int(np.argmax(np.sum(weights * products, axis=1)))
    most = _delay_parameters(context)[0].upper / max(_SWING_MEANS)
    cosine, sine = np.clip(weights[place], -most / 2, most / 2).tolist()
    frequency, amplitude = float(swings[place]) / context.fit_end_time, float(np.hypot(cosine, sine))
    return tuple((part * amplitude, cosine, sine, frequency) for part in _SWING_MEANS)


VARYING_DELAY = Effect(
    name="varying-delay",
    title="delay of the input that swings",
    summary="The delay of the input swings about its mean: u(t - mean - a cos(2 pi f t) - b sin(2 pi f t))",
    family="timing",
    site=Site.INPUT,
    parameters=_varying_delay_parameters,
    starting_points=_varying_delay_starting_points,
    form=_varying_delay_form,
    equation=lambda _: MapEquation("z0", (("interpolate", "0", "n0", "n1", "n2", "n3"),)),
    formula=Formula("at(x, t - tau - a*cos(2*pi*f*t) - b*sin(2*pi*f*t))", symbols=("tau", "a", "b", "f")),
    source="Ljung, System Identification, 2nd ed., section 16",
    is_applicable=lambda context: context.measured is not None,
    linear_parameters=3,
    extra_degrees_of_freedom=2,
    is_tuned=True,
    depends_on_time=True,
    similar_to="delay, clock-skew, sensor-lag, resonance",
    distinguished_by="a residual proportional to the rate of the output, with a factor that swings over time",
    occurs_in="transport at a changing speed, networks with a changing load",
)


CLOCK_SKEW = Effect(
    name="clock-skew",
    title="different clock rates",
    summary="The clocks of input and output differ in rate: u(t (1 + e))",
    family="timing",
    site=Site.INPUT,
    parameters=lambda context: (
        Parameter("e", "", 0.0, 0.01 * context.dt / context.fit_end_time, -0.02, 0.02),
    ),
    starting_points=lambda context, _: (
        (0.5 * context.dt / context.fit_end_time,),
        (-0.5 * context.dt / context.fit_end_time,),
    ),
    form=lambda u, values, _: interpolate_at(u, np.arange(u.size) * (1.0 + values[0])),
    equation=lambda _: MapEquation("z0", (("interpolate", "n0", "0", "0", "0", "0"),)),
    formula=Formula("at(x, t*(1 + e))"),
    source="Schoukens and Pintelon, System Identification: A Frequency Domain Approach, section 2",
    similar_to="delay",
    distinguished_by="a delay that grows along the record",
    occurs_in="two devices that record with their own clocks",
)


#: Number of rates that the calibration starts from.
_STARTING_RATES = 16


def _rate_limit_form(u: Signal, values: Signal, context: SimulationContext) -> Signal:
    if values[0] <= 0.0:
        return u
    intervals = context.dt if context.intervals is None else context.intervals
    limited: Signal = limit_rate(u, intervals / values[0])
    return limited


def _get_rate_range(context: SimulationContext) -> tuple[float, float]:
    """Return the rate that crosses the range of the input once, and the peak rate, per second."""
    steps = np.abs(context.take_differences(context.u))
    return float(np.ptp(context.u)) / context.fit_end_time, float(np.max(steps)) / context.dt


def _rate_limit_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    _, peak = _get_rate_range(context)
    most = 10.0 * context.fit_end_time / (context.input_peak or 1.0)
    return (
        Parameter("inverse_rate", f"s/{context.input_unit}", 0.0, 0.1 / peak if peak else most, 0.0, most),
    )


def _rate_limit_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    least, peak = _get_rate_range(context)
    rates = np.geomspace(0.9 * peak, 2.0 * least, _STARTING_RATES)
    return tuple((1.0 / float(rate),) for rate in rates)


def _has_rates_to_limit(context: SimulationContext) -> bool:
    # With a sine of one amplitude, the limit is an odd distortion, as that of dry friction.
    least, peak = _get_rate_range(context)
    return peak > 4.0 * least and find_single_frequency(context) is None


RATE_LIMIT = Effect(
    name="rate-limit",
    title="rate limit of the input",
    summary="Rate limit of the actuator (slew rate): |u'| is at most 1/inverse_rate",
    family="timing",
    site=Site.INPUT,
    parameters=_rate_limit_parameters,
    starting_points=_rate_limit_starting_points,
    form=_rate_limit_form,
    equation=lambda _: MapEquation("z0", (("limit-rate", "n0"),)),
    acts_between_samples=True,
    is_applicable=_has_rates_to_limit,
    formula=Formula(
        "limit_rate(x, 1/r)",
        symbols=("r",),
        note="limit_rate({x}, 1/{r}) follows {x} with a rate of at most 1/{r}",
    ),
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    linear_parameters=0,
    similar_to="sensor-lag, delay, input-saturation",
    distinguished_by="the lag grows with the amplitude; slow inputs are followed without error",
    occurs_in="valve actuators, ramps of a drive, amplifiers with capacitive loads",
)


SENSOR_LAG = Effect(
    name="sensor-lag",
    title="lag of the sensor",
    summary="First-order lag of the sensor: tau y' + y = v",
    family="timing",
    site=Site.OUTPUT,
    parameters=lambda context: (Parameter("tau", "s", 0.0, context.dt, 0.0, context.fit_end_time / 4),),
    starting_points=lambda context, _: ((0.3 * context.dt,), (2 * context.dt,), (6 * context.dt,)),
    form=lambda y, values, context: low_pass(y, values[0], context.dt) if values[0] > 0.0 else y,
    equation=lambda _: MapEquation("z0", (("low-pass", "n0"),)),
    formula=Formula("y", states=(("y", "(x - y)/tau"),)),
    source="Doebelin, Measurement Systems, section 3",
    similar_to="delay, resonance, viscous",
    distinguished_by="the amplitude falls with the frequency",
    occurs_in="thermocouples in a sheath, pressure lines, filters of an amplifier",
)


def _growing_lag_form(y: Signal, values: Signal, context: SimulationContext) -> Signal:
    lagged: Signal = lag_by_gap(y, context.dt, values[0], values[1])
    return lagged


def _growing_lag_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    most = context.fit_end_time / 4
    peak = context.output_peak
    return (
        Parameter("tau", "s", 0.0, context.dt, 0.0, most),
        Parameter("inverse_rate", f"s/{context.output_unit}", 0.0, context.dt / peak, 0.0, most / peak),
    )


def _growing_lag_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    times = (2 * context.dt, 6 * context.dt)
    return tuple((tau, part * tau / context.output_peak) for tau in times for part in (1.0, 5.0))


GROWING_LAG = Effect(
    name="growing-lag",
    title="lag of the sensor that grows with its error",
    summary="Lag of the sensor that grows with its error e = v - y: y' = e/(tau + inverse_rate |e|)",
    family="timing",
    site=Site.OUTPUT,
    parameters=_growing_lag_parameters,
    starting_points=_growing_lag_starting_points,
    form=_growing_lag_form,
    equation=lambda _: MapEquation("z0", (("lag-by-gap", "n0", "n1"),)),
    formula=Formula("y", symbols=("tau", "r"), states=(("y", "(x - y)/(tau + r*abs(x - y))"),)),
    source="Isermann, Fault-Diagnosis Applications, section 5",
    linear_parameters=0,
    similar_to="sensor-lag, rate-limit, output-lag-curve",
    distinguished_by="large changes are followed more slowly than small ones, relative to their size",
    occurs_in="sensors behind a film of steam or a deposit, instruments with a largest rate",
)

#: Largest natural frequency in radians per sample; a faster mode has no effect on the record.
FASTEST = 2.6


def _resonance_form(y: Signal, values: Signal, context: SimulationContext) -> Signal:
    period, zeta = values
    w = 2 * np.pi / period if period > 0.0 else np.inf
    if w * context.dt > FASTEST:
        return y
    # Bilinear transform, prewarped at the resonance. A discretisation with finer steps, which interpolates
    # the output between samples, would imitate a delay on coarsely sampled records (the gas furnace, the hair
    # dryer).
    k = w / np.tan(w * context.dt / 2)
    scale = k * k + 2 * zeta * w * k + w * w
    b = w * w / scale
    a1, a2 = 2 * (w * w - k * k) / scale, (k * k - 2 * zeta * w * k + w * w) / scale
    out: Signal = filter_linearly([b, 2 * b, b], [1.0, a1, a2], y - y[0]) + y[0]
    return out


RESONANCE = Effect(
    name="resonance",
    title="resonance at the output",
    summary="Second-order mode in series with the output: y'' + 2 zeta w y' + w^2 y = w^2 v",
    family="timing",
    site=Site.OUTPUT,
    parameters=lambda context: (
        Parameter("period", "s", 0.0, context.dt, 0.0, context.fit_end_time / 8),
        Parameter("zeta", "", 0.1, 0.05, 0.003, 2.0),
    ),
    starting_points=lambda context, _: tuple(
        (period * context.dt, zeta) for period in (2.9, 5.0, 9.0, 16.0, 30.0) for zeta in (0.03, 0.1, 0.3)
    ),
    form=_resonance_form,
    equation=lambda _: MapEquation("z0", (("resonance", "n0", "n1"),)),
    formula=Formula(
        "y", symbols=("P", "zeta"), states=(("y", "w"), ("w", "(2*pi/P)**2*(x - y) - 4*pi*zeta/P*w"))
    ),
    source="Ljung, System Identification, 2nd ed., section 4",
    similar_to="delay, sensor-lag",
    distinguished_by="ringing after fast changes",
    occurs_in="flexible shafts, couplings and frames between drive and sensor, sensor mounts",
)
