"""Interface of the simulators that are compared with a record."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Self

import numpy as np

from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Site

#: Force laws on the coordinate of a simulator, each with its values.
Forces = Sequence[tuple[ForceLaw, Signal]]


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
        Map of the input that acts on the values between samples as well, ``(values, intervals) -> values`` of
        shape (values,) in the order of time; None for none. The intervals before the values are in seconds.
        Only simulators in continuous time have runs with one. Runs with the same map have the same object.
    """

    values: Signal
    x: Signal
    effect_parameters: Mapping[str, float]
    forces: Forces
    intersample_values: Signal | None = None
    near: int | None = None
    characteristic: Callable[[Signal, Signal], Signal] | None = None

    @property
    def input_key(self) -> tuple[int, int]:
        """Key of the input and its characteristic; runs with the same objects have the same one."""
        return id(self.x), id(self.characteristic)

    def apply_characteristic(self, signal: Signal, dt: float) -> Signal:
        """Return values of the input after ``characteristic``.

        Parameters
        ----------
        signal : ndarray, shape (steps,) or (steps, 3)
            Value at the start of each step, or those at its start, in its middle and at its end.
        dt : float
            Duration of a step in seconds.
        """
        if self.characteristic is None:
            return signal
        intervals = np.full(signal.shape, dt if signal.ndim == 1 else 0.5 * dt)
        if signal.ndim > 1:
            intervals[:, 0] = 0.0
        return self.characteristic(signal.reshape(-1), intervals.reshape(-1)).reshape(signal.shape)


class Simulator(ABC):
    """Simulator: parameters, sites at which effects can enter, and simulation of the output.

    A subclass defines ``name``, ``sites`` and `simulate`; everything else has a default. Subclasses that
    compute several runs at once derive from `BatchSimulator`.
    """

    __slots__ = ()

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in reports; that of the command line for a physical system."""

    @property
    def equations(self) -> str:
        """Equations in one line for reports; the name by default."""
        return self.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the simulator; none by default."""
        return ()

    @property
    @abstractmethod
    def sites(self) -> frozenset[Site]:
        """Sites at which effects can enter."""

    @property
    def supported_effects(self) -> frozenset[str]:
        """Names of the effects of the catalogue that the state equation supports; none by default."""
        return frozenset()

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Names of the effects already modelled by the simulator; excluded from the search."""
        return frozenset()

    @property
    def state_effects(self) -> tuple[Effect, ...]:
        """Effects on the states of the simulator, in addition to the catalogue."""
        return ()

    @property
    def is_continuous_time(self) -> bool:
        """Whether a differential equation is integrated, so that the input between samples matters."""
        return False

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Relative standard deviations of parameters about their nominal values, by name."""
        return MappingProxyType({})

    @property
    def read_channels(self) -> frozenset[str]:
        """Channels of the record that are read by their names."""
        return frozenset()

    @property
    def fits_states(self) -> bool:
        """Whether states are fitted to the record within each simulation."""
        return False

    @property
    def is_recorded(self) -> bool:
        """Whether the output was recorded, and is known for the input of the record alone."""
        return False

    @property
    def is_batch(self) -> bool:
        """Whether several runs at once cost less than one by one."""
        return False

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the coordinate that forces act on: the input, unless a subclass has another one.

        Parameters
        ----------
        output : ndarray, shape (samples,)
            Nominal output.
        """
        return input_coordinate(context, output)

    def for_samples(self, first: int, last: int) -> Self:  # noqa: ARG002 - for subclasses with samples
        """Return the simulator of a recording that begins at sample ``first`` and ends before ``last``.

        A simulator that contains samples of the record, such as measured initial outputs, returns another
        one.
        """
        return self

    @abstractmethod
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
        outputs = []
        for run in runs:
            own, x = context, run.x
            if run.intersample_values is not None:
                moments = np.column_stack([run.x, *run.intersample_values])
                x, *between = np.ascontiguousarray(run.apply_characteristic(moments, context.dt).T)
                own = replace(context, u=x, intersample_values=np.stack(between))
            elif run.characteristic is not None:
                x = run.apply_characteristic(run.x, context.dt)
            output = self.simulate(run.values, x, own, run.effect_parameters, run.forces)
            outputs.append(output[::every])
        return np.stack(outputs)


class BatchSimulator(Simulator):
    """Simulator that computes several runs at once, faster than one by one and with the same bits."""

    __slots__ = ()

    @property
    def is_batch(self) -> bool:
        """True."""
        return True

    @abstractmethod
    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; see `Simulator.simulate_batch`."""

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate one run; see `Simulator.simulate`."""
        run = SimulationRun(values, x, effect_parameters, forces)
        return self.simulate_batch([run], context)[0].copy()


@dataclass(frozen=True, slots=True, eq=False)
class SimulatorWrapper(Simulator):
    """Base class of simulators that run another one; forwards what that one declares.

    Attributes
    ----------
    simulator : Simulator
        The simulator that is run.
    """

    simulator: Simulator

    @property
    def name(self) -> str:
        """Name of the wrapped simulator."""
        return self.simulator.name

    @property
    def equations(self) -> str:
        """Equations of the wrapped simulator."""
        return self.simulator.equations

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
        return self.simulator.tolerances

    @property
    def read_channels(self) -> frozenset[str]:
        """Channels that the wrapped simulator reads."""
        return self.simulator.read_channels

    @property
    def fits_states(self) -> bool:
        """Whether the wrapped simulator fits states to the record."""
        return self.simulator.fits_states

    @property
    def is_recorded(self) -> bool:
        """Whether the output of the wrapped simulator was recorded."""
        return self.simulator.is_recorded

    @property
    def is_batch(self) -> bool:
        """Whether the wrapped simulator computes several runs at once."""
        return self.simulator.is_batch

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the force coordinate of the wrapped simulator."""
        return self.simulator.make_force_coordinate(context, output)

    def for_samples(self, first: int, last: int) -> Self:
        """Return the wrapper of the simulator of one recording."""
        return replace(self, simulator=self.simulator.for_samples(first, last))


def split_recordings(
    simulator: Simulator, context: SimulationContext
) -> tuple[tuple[Simulator, SimulationContext], ...]:
    """Return the simulator and the context of each recording."""
    if len(context.bounds) == 1:
        return ((simulator, context),)
    return tuple(
        (simulator.for_samples(*bounds), part)
        for bounds, part in zip(context.bounds, context.split(), strict=True)
    )


def input_coordinate(context: SimulationContext, output: Signal) -> ForceCoordinate:
    """Return the input as the coordinate, for simulators without inertia: forces are added to the output."""
    rate = float(np.std(context.take_differences(context.u))) / context.dt or 1.0
    return ForceCoordinate(
        context.input_unit, context.input_peak, rate, context.output_unit, peak_amplitude(output)
    )


def output_coordinate(context: SimulationContext, output: Signal) -> ForceCoordinate:
    """Return the output as the coordinate, for simulators with inertia: forces are added to the input."""
    rate = float(np.std(context.take_differences(output))) / context.dt or 1.0
    return ForceCoordinate(
        context.output_unit,
        peak_amplitude(output),
        rate,
        context.input_unit,
        context.input_peak,
        is_dissipative=True,
        friction_smoothing=0.02,
    )


def peak_amplitude(signal: Signal) -> float:
    """Return the largest absolute value; 1 if the signal is zero."""
    return float(np.max(np.abs(signal))) or 1.0
