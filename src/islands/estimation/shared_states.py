"""Latent models of several outputs with shared states: linear, and with an effect of the amplitude.

The effect is a feedback whose gain follows the mean magnitude of the inputs, which is one further state,

    a(k+1) = r a(k) + (1 - r) mean |u(k)|,    h(k) = a(k) z(k) = ((z + a)^2 - (z - a)^2) / 4,

so that the models have units of one argument, as all latent models (see `linear.spectral_fit`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.estimation.latent_data import LARGEST_MEMORY, SignalScales
from islands.estimation.linear.frequency_response import estimate_response
from islands.estimation.linear.spectral_fit import (
    ResponseAtAmplitude,
    SharedSystem,
    draw_systems,
    fit_shared_system,
    refine,
    schedule,
)
from islands.kernels.linear_filter import divide_rows
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.latent import LatentModel, StateSpaceLayout
from islands.parallel import one_blas_thread
from islands.progress import Steps
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_all_inputs

Signal = NDArray[np.float64]

#: Samples of a block at least and at most, and the largest order.
_SHORTEST, _LONGEST, _LARGEST_ORDER = 256, 16_384, 40

#: Ratio of the amplitudes of blocks that differ, and number of different ones at most.
_DIFFERENT, _MOST_AMPLITUDES = 1.25, 4

#: Largest ripple of the amplitude of a stationary input, relative to its mean.
_RIPPLE = 0.05

#: Draws from the distribution of the parameters. A free run of each is a member of the bands.
_DRAWS = 24

#: Samples for each state from which the initial states of a free run of the result are estimated, at least.
_SAMPLES_PER_STATE = 3


@dataclass(frozen=True, slots=True, eq=False)
class SharedModel:
    """State space whose states all outputs share, and its uncertainty.

    Attributes
    ----------
    model : CoupledLatentModel
    size : int
        Number of parameters that have an effect: coordinates of the states have none.
    draws : ndarray, shape (draws, parameters)
        Parameters of the model from the distribution of the estimate.
    """

    model: CoupledLatentModel
    size: int
    draws: Signal


@one_blas_thread
def search_shared_models(record: CoupledRecord, seed: int, steps: Steps) -> list[SharedModel]:
    """Search state spaces whose states all outputs share.

    Parameters
    ----------
    record : CoupledRecord
    seed : int
        Of the starts of the effect of the amplitude, and of the draws.
    steps : Steps

    Returns
    -------
    list of SharedModel
        A linear system, and one with an effect of the amplitude if the record has different amplitudes.
        Empty if the record is too short, lacks outputs or has a constant column.
    """
    if min(record.segments) < _SHORTEST or not np.isfinite(record.y).all():
        return []
    scales = [SignalScales.measure(each) for each in record.records]
    u = scales[0].scale_inputs(record.u)
    y = np.column_stack(
        [scale.scale_outputs(each.y) for scale, each in zip(scales, record.records, strict=True)]
    )
    steps.report("linear state space with shared states", 0.0)
    data, mean, unit = _measure_responses(record, u, y)
    system = fit_shared_system(data, _LARGEST_ORDER) if data else None
    if system is None or not system.order:
        return []
    equal = np.mean([each.response.variances for each in data], axis=0)
    alike = [replace(each, response=replace(each.response, variances=equal)) for each in data]
    linear = refine(system, alike) if len(data) > 1 else system
    signals = _Signals(record, scales, u)
    found = [_make_model(linear, alike, None, signals, seed)]
    if len(data) > 1 and not steps.skip("effect of the amplitude"):
        steps.report("effect of the amplitude on the state space", 0.3)
        amplitude = _Amplitude(mean, unit, _find_forgetting(u, record))
        found.append(_make_model(schedule(system, data, seed), data, amplitude, signals, seed))
    return found


class _Amplitude(NamedTuple):
    """Mean amplitude of a record, the unit of its deviation, and the pole of the state that follows it."""

    mean: float
    unit: float
    pole: float


@dataclass(frozen=True, slots=True, eq=False)
class _Signals:
    """A record, the scales of every output, and the scaled inputs."""

    record: CoupledRecord
    scales: Sequence[SignalScales]
    u: Signal


def _make_model(
    system: SharedSystem,
    data: Sequence[ResponseAtAmplitude],
    amplitude: _Amplitude | None,
    signals: _Signals,
    seed: int,
) -> SharedModel:
    """Return the model of a system that was fitted to the responses, with draws of its parameters."""
    units = _measure_states(system)
    drawn = draw_systems(system, data, _DRAWS, np.random.default_rng(seed))
    model, *draws = (
        CoupledLatentModel(_write_outputs(each, amplitude, signals, units)) for each in (system, *drawn)
    )
    # A draw has the parameters of the model, unless one of them is exactly zero.
    kept = [each.parameters for each in draws if each.parameter_names == model.parameter_names]
    return SharedModel(model, system.size, np.array(kept or [model.parameters]))


def _measure_responses(
    record: CoupledRecord, u: Signal, y: Signal
) -> tuple[list[ResponseAtAmplitude], float, float]:
    """Return the responses at different amplitudes, a middle one first, and the mean and unit of these."""
    length = min(_LONGEST, *record.segments)
    first = [
        begin
        for start, end in record.bounds
        for begin in np.linspace(start, end - length, -(-(end - start) // length)).astype(int).tolist()
    ]
    sizes = np.array([np.abs(u[begin : begin + length]).mean() for begin in first])
    ratio = max(_DIFFERENT, (sizes.max() / max(sizes.min(), 1e-12)) ** (1.0 / _MOST_AMPLITUDES))
    groups: list[list[int]] = []
    for place in np.argsort(sizes, kind="stable").tolist():
        if groups and sizes[place] <= ratio * sizes[groups[-1][0]]:
            groups[-1].append(place)
        else:
            groups.append([place])
    found = []
    for group in groups:
        rows = np.array([np.arange(first[place], first[place] + length) for place in group])
        response = estimate_response(u[rows], y[rows])
        if response is not None:
            found.append(ResponseAtAmplitude(response, float(sizes[group].mean())))
    if not found:
        return [], 0.0, 1.0
    middle = found[len(found) // 2]
    mean, unit = middle.amplitude, max(abs(each.amplitude - middle.amplitude) for each in found) or 1.0
    ordered = [middle, *(each for each in found if each is not middle)]
    scaled = [replace(each, amplitude=(each.amplitude - mean) / unit) for each in ordered]
    return scaled, mean, unit


def _find_forgetting(u: Signal, record: CoupledRecord) -> float:
    """Return the pole of the amplitude: the fastest one whose ripple is small."""
    size = np.abs(u).mean(axis=1)
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    rows = size[None, begin:end]
    pole, samples = 0.0, 8
    while samples < (end - begin) // 8:
        pole = 1.0 - 1.0 / samples
        level = (1.0 - pole) * divide_rows(np.array([-pole]), rows, np.array([end - begin]))[0, 4 * samples :]
        if level.std() < _RIPPLE * level.mean():
            break
        samples *= 2
    return pole


def _write_outputs(
    system: SharedSystem,
    amplitude: _Amplitude | None,
    given: _Signals,
    state_units: tuple[Signal, Signal],
) -> tuple[LatentModel, ...]:
    """Return the model of every output in the units of the record.

    Parameters
    ----------
    system : SharedSystem
        Of scaled signals.
    amplitude : _Amplitude or None
        None of a linear system.
    given : _Signals
    state_units : (ndarray, ndarray)
        Units of the states, and of the signals of the feedback.
    """
    record, scales = given.record, given.scales
    order, inputs = system.b.shape
    signals = system.signals if amplitude else 0
    extra = 1 if signals else 0
    layout = StateSpaceLayout(order + extra, inputs, inputs * extra + 2 * signals)
    theta = np.zeros(len(layout.names))
    blocks = layout.split(theta)
    scale, products = state_units
    blocks["A"][:order, :order] = system.a * scale / scale[:, None]
    blocks["B"][:order] = system.b / scale[:, None]
    units: tuple[str, ...] = ()
    if amplitude:
        mean, unit, pole = amplitude
        units = ("abs",) * inputs + ("square",) * (2 * signals)
        blocks["A"][order, order] = pole
        blocks["o"][order] = -(1.0 - pole) * mean / unit
        blocks["E"][order, :inputs] = (1.0 - pole) / (inputs * unit)
        blocks["W"][:inputs, order + 1 :] = np.eye(inputs)
        weights = np.hstack([system.w * scale, np.zeros((signals, 1)), system.v]) / products[:, None]
        for place, sign in ((inputs, 1.0), (inputs + signals, -1.0)):
            these = slice(place, place + signals)
            blocks["W"][these] = weights
            blocks["W"][these, order] = sign
            blocks["E"][:order, these] = sign * 0.25 * products * system.e / scale[:, None]
    models = []
    radius = float(np.abs(np.linalg.eigvals(system.a)).max(initial=0.0))
    for place, (own, each) in enumerate(zip(scales, record.records, strict=True)):
        of_output = theta.copy()
        blocks = layout.split(of_output)
        blocks["C"][:order] = system.c[place] * scale
        blocks["D"][...] = system.d[place]
        if amplitude:
            for begin, sign in ((inputs, 1.0), (inputs + signals, -1.0)):
                blocks["F"][begin : begin + signals] = sign * 0.25 * products * system.f[place]
        models.append(
            _write_output(
                own.use_record_units(layout, of_output), layout, units, radius, own, each, system.is_direct
            )
        )
    return tuple(models)


def _write_output(
    theta: Signal,
    layout: StateSpaceLayout,
    units: tuple[str, ...],
    radius: float,
    scales: SignalScales,
    record: Dataset,
    is_direct: bool,
) -> LatentModel:
    read = advance_all_inputs(record) if is_direct else record
    decay = np.log(0.01) / np.log(min(max(radius, 1e-3), 1.0 - 1e-6))
    shortest = 0.05 * min(record.segments)
    memory = 1 + round(max(_SAMPLES_PER_STATE * layout.order, min(LARGEST_MEMORY - 1, decay, shortest)))
    return LatentModel(
        order=layout.order,
        units=units,
        wiring=tuple(name for name, value in zip(layout.names, theta, strict=True) if value != 0.0),
        memory=memory,
        operating_inputs=tuple(scales.mean.tolist()),
        parameters=tuple(value for value in theta.tolist() if value != 0.0),
        input_names=read.input_names,
        output_name=record.output_name,
        dt=record.dt,
        preprocessing=record.preprocessing,
    )


def _measure_states(system: SharedSystem) -> tuple[Signal, Signal]:
    """Return the standard deviations of the states and of the signals of the feedback for white inputs."""
    # Lyapunov equation by doubling: sum of A^k B B' A'^k.
    covariance, power = system.b @ system.b.T, system.a
    for _ in range(60):
        covariance = covariance + power @ covariance @ power.T
        power = power @ power
        if np.abs(power).max(initial=0.0) < 1e-12:
            break
    signals = np.einsum("ij,jk,ik->i", system.w, covariance, system.w) + np.sum(system.v**2, axis=1)
    return np.sqrt(np.maximum(np.diag(covariance), 1e-24)), np.sqrt(np.maximum(signals, 1e-24))
