"""Interface of the simulators that are compared with a record."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Site

#: Force laws on the coordinate of a simulator, each with its values.
Forces = Sequence[tuple[ForceLaw, Signal]]


class Simulator(Protocol):
    """Simulator: parameters, sites at which effects can enter, and simulation of the output."""

    @property
    def name(self) -> str:
        """Name in reports; that of the command line for a physical system."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the simulator."""

    @property
    def sites(self) -> frozenset[Site]:
        """Sites at which effects can enter."""

    @property
    def supported_effects(self) -> frozenset[str]:
        """Names of the effects of the catalogue that the state equation supports."""

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Names of the effects already modelled by the simulator; excluded from the search."""

    @property
    def state_effects(self) -> tuple[Effect, ...]:
        """Effects on the states of the simulator, in addition to the catalogue."""

    @property
    def is_continuous_time(self) -> bool:
        """Whether a differential equation is integrated, so that the input between samples matters."""

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the coordinate that forces act on; ``output`` is the nominal output, shape (samples,)."""

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        x : ndarray, shape (samples,)
            Input after the input maps.
        context : SimulationContext
        effect_parameters : mapping
            Parameters of supported effects by name; an effect without parameters here is not active.
        forces : sequence
            Force laws on the coordinate, each with its values.

        Returns
        -------
        ndarray, shape (samples,)
            Output before the output maps.
        """


@runtime_checkable
class RecordBoundSimulator(Protocol):
    """Simulator that contains samples of the record, such as measured initial outputs."""

    def for_samples(self, first: int, last: int) -> Simulator:
        """Return the simulator of a recording that begins at sample ``first`` and ends before ``last``."""


@runtime_checkable
class TolerancedSimulator(Protocol):
    """Simulator that states how well its parameters are known."""

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Relative standard deviations of parameters about their nominal values, by name."""


def get_tolerances(simulator: Simulator) -> Mapping[str, float]:
    """Return the tolerances that a simulator states; most simulators state none."""
    return simulator.tolerances if isinstance(simulator, TolerancedSimulator) else {}


@dataclass(frozen=True, slots=True, eq=False)
class SimulationRun:
    """Arguments of one simulation, as of `Simulator.simulate`, without the context.

    Attributes
    ----------
    values : ndarray, shape (parameters,)
    x : ndarray, shape (samples,)
        Input before ``characteristic``.
    effect_parameters : mapping
    forces : sequence
    intersample_values : ndarray, shape (2, samples), or None
        Values of x between samples; None for those of the context.
    near : int or None
        Index of the run of the same call from which this one differs by a small change. Its output is needed
        for derivatives: a simulator that fits states may fit those of this run to first order.
    characteristic : callable or None
        Static map of the input that acts on the values between samples as well, ``values -> values`` of shape
        (values,); None for none. Only simulators in continuous time have runs with one. Runs with the same
        map have the same object.
    """

    values: Signal
    x: Signal
    effect_parameters: Mapping[str, float]
    forces: Forces
    intersample_values: Signal | None = None
    near: int | None = None
    characteristic: Callable[[Signal], Signal] | None = None

    @property
    def input_key(self) -> tuple[int, int]:
        """Key of the input and its characteristic; runs with the same objects have the same one."""
        return id(self.x), id(self.characteristic)

    def apply_characteristic(self, signal: Signal) -> Signal:
        """Return values of the input, of any shape, after ``characteristic``."""
        if self.characteristic is None:
            return signal
        return self.characteristic(signal.reshape(-1)).reshape(signal.shape)


@runtime_checkable
class BatchSimulator(Protocol):
    """Simulator that computes several runs at once, faster than one by one and with the same bits."""

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate the outputs of runs with the same effects and force laws.

        Parameters
        ----------
        every : int
            The outputs have one sample of ``every`` successive ones, the first.

        Returns
        -------
        ndarray, shape (runs, samples)
        """


class BatchSimulation:
    """Base class of simulators that compute several runs at once."""

    __slots__ = ()

    def simulate(
        self: BatchSimulator,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate one run; see `Simulator.simulate`."""
        run = SimulationRun(values, x, effect_parameters, forces)
        return self.simulate_batch([run], context)[0].copy()


@runtime_checkable
class WrappingSimulator(Protocol):
    """Simulator that runs another one."""

    @property
    def simulator(self) -> Simulator:
        """The simulator that is run."""


@runtime_checkable
class ShootingSimulator(Protocol):
    """Simulator that may fit the states of shooting intervals to the record within each simulation."""

    @property
    def shots(self) -> object | None:
        """Shooting intervals; None for a free run."""


@runtime_checkable
class ChannelReadingSimulator(Protocol):
    """Simulator that reads channels of the record by their names."""

    @property
    def channels(self) -> Mapping[str, str]:
        """Channels of the record by the names that the simulator gives to them."""


def _unwrap(simulator: Simulator) -> Simulator:
    while isinstance(simulator, WrappingSimulator):
        simulator = simulator.simulator
    return simulator


def is_batch_simulator(simulator: Simulator) -> bool:
    """Return whether a simulator, or the one that it runs, computes several runs at once."""
    return isinstance(_unwrap(simulator), BatchSimulator)


def fits_states(simulator: Simulator) -> bool:
    """Return whether a simulator, or the one that it runs, fits states to the record in each simulation."""
    inner = _unwrap(simulator)
    return isinstance(inner, ShootingSimulator) and inner.shots is not None


def find_read_channels(simulator: Simulator) -> frozenset[str]:
    """Return the channels of the record that a simulator, or the one that it runs, reads by their names."""
    inner = _unwrap(simulator)
    return frozenset(inner.channels.values()) if isinstance(inner, ChannelReadingSimulator) else frozenset()


def simulate_runs(
    simulator: Simulator, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
) -> Signal:
    """Simulate as `BatchSimulator.simulate_batch`, at once if the simulator can."""
    if isinstance(simulator, BatchSimulator):
        return simulator.simulate_batch(runs, context, every)
    outputs = []
    for run in runs:
        own, x = context, run.apply_characteristic(run.x)
        if run.intersample_values is not None:
            between = run.apply_characteristic(run.intersample_values)
            own = replace(context, u=x, intersample_values=between)
        output = simulator.simulate(run.values, x, own, run.effect_parameters, run.forces)
        outputs.append(output[::every])
    return np.stack(outputs)


def take_recording(simulator: Simulator, first: int, last: int) -> Simulator:
    """Return the simulator of one of several recordings; most simulators are the same for all of them."""
    return simulator.for_samples(first, last) if isinstance(simulator, RecordBoundSimulator) else simulator


def split_recordings(
    simulator: Simulator, context: SimulationContext
) -> tuple[tuple[Simulator, SimulationContext], ...]:
    """Return the simulator and the context of each recording."""
    if len(context.bounds) == 1:
        return ((simulator, context),)
    return tuple(
        (take_recording(simulator, *bounds), part)
        for bounds, part in zip(context.bounds, context.split(), strict=True)
    )
