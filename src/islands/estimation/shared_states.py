"""Latent models of several outputs with shared states: linear, and with an effect of the amplitude.

The effect is a feedback whose gain follows the mean magnitude of the inputs, which is one further state,

    a(k+1) = r a(k) + (1 - r) mean |u(k)|,    h(k) = a(k) z(k) = ((z + a)^2 - (z - a)^2) / 4,

so that the models have units of one argument, as all latent models (see `linear.spectral_fit`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from islands.estimation.latent_data import LARGEST_MEMORY, SignalScales
from islands.estimation.linear.frequency_response import estimate_response
from islands.estimation.linear.spectral_fit import (
    ResponseAtAmplitude,
    SharedSystem,
    fit_shared_system,
    refine,
    schedule,
)
from islands.kernels.linear_filter import divide_rows
from islands.models.latent import LatentModel, StateSpaceLayout
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

#: Samples for each state from which the initial states of a free run of the result are estimated, at least.
_SAMPLES_PER_STATE = 3


def search_shared_models(
    record: CoupledRecord, seed: int, steps: Steps, least_order: int = 0
) -> list[tuple[LatentModel, ...]]:
    """Search state spaces whose states all outputs share.

    Parameters
    ----------
    record : CoupledRecord
    seed : int
        Of the starts of the effect of the amplitude.
    steps : Steps
    least_order : int
        A state space of a smaller order is not returned.

    Returns
    -------
    list of tuple of LatentModel
        One model for each output: of a linear system, and of one with an effect of the amplitude if the
        record has different amplitudes. Empty if the record is too short, lacks outputs or has a constant
        column.
    """
    if min(record.segments) < _SHORTEST or not np.isfinite(record.y).all():
        return []
    scales = [SignalScales.measure(each) for each in record.records]
    u = scales[0].scale_inputs(record.u)
    y = np.column_stack(
        [scale.scale_outputs(each.y) for scale, each in zip(scales, record.records, strict=True)]
    )
    steps.report("linear state space with shared states", 0.0)
    # The sums of a matrix product depend on the number of threads of the library.
    with threadpool_limits(1, user_api="blas"):
        data, amplitudes = _measure_responses(record, u, y)
        system = fit_shared_system(data, _LARGEST_ORDER) if data else None
        if system is None or system.order < least_order:
            return []
        equal = np.mean([each.response.variances for each in data], axis=0)
        alike = [replace(each, response=replace(each.response, variances=equal)) for each in data]
        linear = refine(system, alike) if len(data) > 1 else system
        found = [_make_models(linear, None, record, scales, u)]
        if len(data) > 1 and not steps.skip("effect of the amplitude"):
            steps.report("effect of the amplitude on the state space", 0.3)
            found.append(_make_models(schedule(system, data, seed), amplitudes, record, scales, u))
    return found


def _measure_responses(
    record: CoupledRecord, u: Signal, y: Signal
) -> tuple[list[ResponseAtAmplitude], tuple[float, float]]:
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
        return [], (0.0, 1.0)
    middle = found[len(found) // 2]
    mean, unit = middle.amplitude, max(abs(each.amplitude - middle.amplitude) for each in found) or 1.0
    ordered = [middle, *(each for each in found if each is not middle)]
    scaled = [replace(each, amplitude=(each.amplitude - mean) / unit) for each in ordered]
    return scaled, (mean, unit)


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


def _make_models(
    system: SharedSystem,
    amplitudes: tuple[float, float] | None,
    record: CoupledRecord,
    scales: Sequence[SignalScales],
    u: Signal,
) -> tuple[LatentModel, ...]:
    """Return the model of every output in the units of the record.

    Parameters
    ----------
    system : SharedSystem
        Of scaled signals.
    amplitudes : (float, float) or None
        Mean amplitude, and the unit of its deviation; None of a linear system.
    record : CoupledRecord
    scales : sequence of SignalScales
        Of every output.
    u : ndarray, shape (samples, inputs)
        Scaled inputs.
    """
    order, inputs = system.b.shape
    signals = system.signals if amplitudes else 0
    extra = 1 if signals else 0
    layout = StateSpaceLayout(order + extra, inputs, inputs * extra + 2 * signals)
    theta = np.zeros(len(layout.names))
    blocks = layout.split(theta)
    scale, products = _measure_states(system)
    blocks["A"][:order, :order] = system.a * scale / scale[:, None]
    blocks["B"][:order] = system.b / scale[:, None]
    units: tuple[str, ...] = ()
    if amplitudes:
        mean, unit = amplitudes
        pole = _find_forgetting(u, record)
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
        if amplitudes:
            for begin, sign in ((inputs, 1.0), (inputs + signals, -1.0)):
                blocks["F"][begin : begin + signals] = sign * 0.25 * products * system.f[place]
        models.append(
            _make_model(
                own.use_record_units(layout, of_output), layout, units, radius, own, each, system.is_direct
            )
        )
    return tuple(models)


def _make_model(
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
