"""A core in finer steps than the record's: what its input does between samples, and how well it is solved."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
import scipy

from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.simulator import Forces, Simulator


class SimulatorWrapper:
    """A core around another one; what it does not say itself, that one says."""

    __slots__ = ()

    simulator: Simulator

    @property
    def name(self) -> str:
        """As the core's."""
        return self.simulator.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """As the core's."""
        return self.simulator.parameters

    @property
    def sites(self) -> frozenset[Site]:
        """As the core's."""
        return self.simulator.sites

    @property
    def supported_effects(self) -> frozenset[str]:
        """As the core's."""
        return self.simulator.supported_effects

    @property
    def built_in_effects(self) -> frozenset[str]:
        """As the core's."""
        return self.simulator.built_in_effects

    @property
    def state_effects(self) -> tuple[Effect, ...]:
        """As the core's."""
        return self.simulator.state_effects

    @property
    def is_continuous_time(self) -> bool:
        """As the core's."""
        return self.simulator.is_continuous_time

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return self.simulator.make_force_coordinate(context, output)


#: Inputs that are remembered between their samples.
_REMEMBERED = 2


class InterSample(StrEnum):
    """What an input does between two samples."""

    FOH = "first-order"
    ZOH = "zero-order"
    BAND_LIMITED = "band-limited"


@dataclass(frozen=True, slots=True, eq=False)
class ResampledSimulator(SimulatorWrapper):
    """A core that is simulated ``oversampling`` as often as it is recorded.

    Attributes
    ----------
    simulator : Simulator
    intersample : InterSample
        It runs straight from sample to sample, stays, or is the smoothest that passes through all samples.
    oversampling : int
    """

    simulator: Simulator
    intersample: InterSample = InterSample.FOH
    oversampling: int = 1
    _known: dict[bytes, tuple[Signal, Signal]] = field(init=False, default_factory=dict)

    def simulate(
        self, values: Signal, x: Signal, context: SimulationContext, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        u, midway = self._finer(x)
        finer = replace(context, u=u, dt=context.dt / self.oversampling, intersample_values=midway)
        return self.simulator.simulate(values, u, finer, own, forces)[:: self.oversampling]

    def _finer(self, x: Signal) -> tuple[Signal, Signal]:
        key = x.tobytes()
        if key not in self._known:
            while len(self._known) >= _REMEMBERED:
                del self._known[next(iter(self._known))]
            self._known[key] = resample_context(x, self.intersample, self.oversampling)
        return self._known[key]


def resample_context(x: Signal, hold: InterSample, times: int) -> tuple[Signal, Signal]:
    """Return a signal ``times`` as often, and midway and at the end of each of its steps.

    Returns
    -------
    ndarray, shape (times * samples,)
        Every ``times``-th one is a sample.
    ndarray, shape (2, times * samples)
    """
    match hold:
        case InterSample.ZOH:
            stays = np.repeat(x, times)
            return stays, np.stack([stays, stays])
        case InterSample.FOH:
            at = np.arange(2 * times * x.size + 1) / (2 * times)
            straight = np.interp(at, np.arange(x.size), x)
        case InterSample.BAND_LIMITED:
            # Its ends are led on by reflection: a filter that meets zeros rings.
            spare = min(64, x.size - 1)
            longer = np.concatenate([2 * x[0] - x[spare:0:-1], x, 2 * x[-1] - x[-2 : -spare - 2 : -1]])
            smooth = scipy.signal.resample_poly(longer, 2 * times, 1, window=("kaiser", 8.0))
            straight = smooth[2 * times * spare : 2 * times * (spare + x.size) + 1]
    return straight[:-1:2].copy(), np.stack([straight[1::2], straight[2::2]])
