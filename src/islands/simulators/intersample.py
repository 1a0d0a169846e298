"""Simulation with a smaller step than the sampling time, and the input between samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from islands.effects.interface.context import Signal, SimulationContext
from islands.simulators.interface import (
    BatchSimulator,
    SimulationRun,
    SimulatorWrapper,
)

#: Samples on each side of a value that the band-limited interpolation reads.
REACH = 10


class InterSample(StrEnum):
    """Behaviour of the input between samples: linear, constant, or band-limited interpolation."""

    FOH = "first-order"
    ZOH = "zero-order"
    BAND_LIMITED = "band-limited"


@dataclass(frozen=True, slots=True, eq=False)
class ResampledSimulator(SimulatorWrapper, BatchSimulator):
    """Simulator with ``oversampling`` steps per sample.

    Attributes
    ----------
    simulator : Simulator
    intersample : InterSample
    oversampling : int
        Steps per sample.
    """

    intersample: InterSample = InterSample.FOH
    oversampling: int = 1

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `Simulator.simulate_batch`."""
        inputs = {id(run.x): run.x for run in runs}
        signals = {key: self._resample(x) for key, x in inputs.items()}
        finer = []
        for run in runs:
            u, between = signals[id(run.x)]
            finer.append(
                SimulationRun(
                    *(run.values, u, run.effect_parameters, run.forces, between, run.near),
                    run.characteristic,
                )
            )
        resampled = replace(
            context,
            u=finer[0].x,
            dt=context.dt / self.oversampling,
            intersample_values=finer[0].intersample_values,
        )
        return self.simulator.simulate_batch(finer, resampled, every * self.oversampling)

    def _resample(self, x: Signal) -> tuple[Signal, Signal]:
        return _resample_bytes(x.tobytes(), self.intersample, self.oversampling)


@lru_cache(maxsize=4)
def _resample_bytes(x: bytes, intersample: InterSample, oversampling: int) -> tuple[Signal, Signal]:
    """Resample an input that successive simulations have in common."""
    return resample_input(np.frombuffer(x), intersample, oversampling)


def resample_input(x: Signal, intersample: InterSample, oversampling: int) -> tuple[Signal, Signal]:
    """Resample an input ``oversampling`` times as fast, with its values within each step.

    Returns
    -------
    ndarray, shape (oversampling * samples,)
        Input at the start of each step; every ``oversampling``-th value is a sample.
    ndarray, shape (2, oversampling * samples)
        Input in the middle and at the end of each step; at a discontinuity the left limit.
    """
    match intersample:
        case InterSample.ZOH:
            held = np.repeat(x, oversampling)
            return held, np.stack([held, held])
        case InterSample.FOH:
            parts = _divide(x.size, 2 * oversampling)
            rises = np.append(np.diff(x), 0.0)
            fine = np.append((rises[:, None] * parts + x[:, None]).reshape(-1), x[-1])
        case InterSample.BAND_LIMITED:
            # Both ends are extended by reflection: with zeros beyond the ends, the filter would ring.
            weights = design_low_pass(2 * oversampling)
            longer = np.pad(x, (REACH, REACH + 1), "reflect", reflect_type="odd")
            near = sliding_window_view(longer, 2 * REACH + 1)
            fine = (np.ascontiguousarray(near) @ weights).reshape(-1)[: 2 * oversampling * x.size + 1]
    return fine[:-1:2].copy(), np.stack([fine[1::2], fine[2::2]])


@lru_cache(maxsize=4)
def _divide(samples: int, factor: int) -> NDArray[np.float64]:
    """Return the places of ``factor`` values after each sample, in samples from it."""
    at = np.arange(samples * factor) / factor
    return at.reshape(samples, factor) - np.arange(samples)[:, None]


@lru_cache(maxsize=8)
def design_low_pass(factor: int) -> NDArray[np.float64]:
    """Return the weights of the samples around each value of a signal with ``factor`` times as many.

    Returns
    -------
    ndarray, shape (2*REACH + 1, factor)
        Weights of the samples from `REACH` before to `REACH` after one, for each value that follows it.
    """
    # Every bit is that of `scipy.signal.firwin`, whose import takes half a second.
    middle = REACH * factor
    places = np.arange(2 * middle + 1) - middle
    window = scipy.special.i0(8.0 * np.sqrt(1.0 - (places / middle) ** 2)) / scipy.special.i0(8.0)
    response = 1.0 / factor * np.sinc(1.0 / factor * places) * window
    response = factor * (response / np.sum(response))
    phases: NDArray[np.float64] = np.append(response, np.zeros(factor - 1)).reshape(-1, factor)[::-1]
    return np.ascontiguousarray(phases)
