"""Simulation with a smaller step than the sampling time, and the input between samples."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.simulators.interface import (
    BatchSimulation,
    SimulationRun,
    Simulator,
    get_tolerances,
    simulate_runs,
    take_recording,
)

#: Samples on each side of a value that the band-limited interpolation reads.
REACH = 10


class SimulatorWrapper:
    """Base class of wrappers of a simulator; forwards all declarations."""

    __slots__ = ()

    simulator: Simulator

    @property
    def name(self) -> str:
        """Name of the wrapped simulator."""
        return self.simulator.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the wrapped simulator."""
        return self.simulator.parameters

    @property
    def sites(self) -> frozenset[Site]:
        """Sites of the wrapped simulator."""
        return self.simulator.sites

    @property
    def supported_effects(self) -> frozenset[str]:
        """Supported effects of the wrapped simulator."""
        return self.simulator.supported_effects

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Built-in effects of the wrapped simulator."""
        return self.simulator.built_in_effects

    @property
    def state_effects(self) -> tuple[Effect, ...]:
        """State effects of the wrapped simulator."""
        return self.simulator.state_effects

    @property
    def is_continuous_time(self) -> bool:
        """Whether the wrapped simulator integrates a differential equation."""
        return self.simulator.is_continuous_time

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Tolerances that the wrapped simulator states."""
        return get_tolerances(self.simulator)

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the force coordinate of the wrapped simulator."""
        return self.simulator.make_force_coordinate(context, output)


class InterSample(StrEnum):
    """Behaviour of the input between samples: linear, constant, or band-limited interpolation."""

    FOH = "first-order"
    ZOH = "zero-order"
    BAND_LIMITED = "band-limited"


@dataclass(frozen=True, slots=True, eq=False)
class ResampledSimulator(BatchSimulation, SimulatorWrapper):
    """Simulator with ``oversampling`` steps per sample.

    Attributes
    ----------
    simulator : Simulator
    intersample : InterSample
    oversampling : int
        Steps per sample.
    """

    simulator: Simulator
    intersample: InterSample = InterSample.FOH
    oversampling: int = 1

    def for_samples(self, first: int, last: int) -> "ResampledSimulator":
        """Return the resampled simulator of one recording."""
        return replace(self, simulator=take_recording(self.simulator, first, last))

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `BatchSimulator.simulate_batch`."""
        signals = {id(run.x): self._resample(run.x) for run in runs}
        finer = []
        for run in runs:
            u, between = signals[id(run.x)]
            finer.append(replace(run, x=u, intersample_values=between))
        resampled = replace(
            context,
            u=finer[0].x,
            dt=context.dt / self.oversampling,
            intersample_values=finer[0].intersample_values,
        )
        return simulate_runs(self.simulator, finer, resampled, every * self.oversampling)

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
            at = np.arange(2 * oversampling * x.size + 1) / (2 * oversampling)
            fine = np.interp(at, np.arange(x.size), x)
        case InterSample.BAND_LIMITED:
            # Both ends are extended by reflection: with zeros beyond the ends, the filter would ring.
            weights = design_low_pass(2 * oversampling)
            longer = np.pad(x, (REACH, REACH + 1), "reflect", reflect_type="odd")
            near = sliding_window_view(longer, 2 * REACH + 1)
            fine = (np.ascontiguousarray(near) @ weights).reshape(-1)[: 2 * oversampling * x.size + 1]
    return fine[:-1:2].copy(), np.stack([fine[1::2], fine[2::2]])


@lru_cache(maxsize=8)
def design_low_pass(factor: int) -> NDArray[np.float64]:
    """Return the weights of the samples around each value of a signal with ``factor`` times as many.

    Returns
    -------
    ndarray, shape (2*REACH + 1, factor)
        Weights of the samples from `REACH` before to `REACH` after one, for each value that follows it.
    """
    response = factor * scipy.signal.firwin(2 * REACH * factor + 1, 1.0 / factor, window=("kaiser", 8.0))
    phases: NDArray[np.float64] = np.append(response, np.zeros(factor - 1)).reshape(-1, factor)[::-1]
    return np.ascontiguousarray(phases)
