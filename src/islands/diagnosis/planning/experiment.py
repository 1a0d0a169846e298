"""Planned experiment: a simulation, an input, the channels that are measured, and their noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from islands.diagnosis.calibration.levenberg_marquardt import prior_precision
from islands.diagnosis.planning.channel_noise import ChannelNoise
from islands.effects.catalogue import catalogue_order
from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredChannel:
    """A signal of the simulation that is measured with noise.

    Attributes
    ----------
    name, unit : str
    simulator : Simulator
        Simulator whose output is this signal.
    context : SimulationContext
    noise : ChannelNoise
    """

    name: str
    unit: str
    simulator: Simulator
    context: SimulationContext
    noise: ChannelNoise


@dataclass(frozen=True, slots=True, eq=False)
class Experiment:
    """An experiment whose data a diagnosis would compare with a simulation.

    Attributes
    ----------
    channels : tuple of MeasuredChannel
        The output, then further channels, which output maps of effects do not change. All have the same input
        and the same parameters.
    prior_std : mapping
        Relative standard deviations of the simulator's parameters about their nominal values.
    estimation_samples : int
        Number of samples, from the first on, that are used for estimation.
    """

    channels: tuple[MeasuredChannel, ...]
    prior_std: Mapping[str, float]
    estimation_samples: int

    @property
    def context(self) -> SimulationContext:
        """Context of the output."""
        return self.channels[0].context

    @property
    def noise(self) -> ChannelNoise:
        """Noise of the output."""
        return self.channels[0].noise

    def colour(self, whitened: Signal) -> Signal:
        """Undo the whitening of data, and return them in standard deviations of the noise.

        Parameters
        ----------
        whitened : ndarray, shape (channels * estimation samples + others,)
            The others, such as deviations from a prior, are returned unchanged.
        """
        ends = self.estimation_samples * np.arange(1, len(self.channels) + 1)
        *parts, others = np.split(whitened, ends)
        coloured = [each.noise.colour(part) for each, part in zip(self.channels, parts, strict=True)]
        return np.concatenate([*coloured, others])

    def with_input(self, u: Signal) -> "Experiment":
        """Return the experiment with another input, sampled at the same times.

        The scales of effects, such as the peak of the input and the duration, remain those of this
        experiment, so that the same values mean the same physics. The measured output is the simulated one.
        """
        fitted = round(self.estimation_samples / self.context.u.size * u.size)
        channels = []
        for channel in self.channels:
            old = channel.context
            changed = {name: np.resize(signal, u.size) for name, signal in old.channels.items()}
            context = replace(
                old,
                u=np.ascontiguousarray(u),
                channels=changed,
                intersample_values=None,
                fit_end_time=fitted * old.dt,
                reference_duration=old.duration,
                segments=(),
            )
            simulation = ExtendedSimulator(channel.simulator, (), context)
            context = replace(context, measured=simulation.simulate(simulation.nominal))
            channels.append(replace(channel, context=context))
        return replace(self, channels=tuple(channels), estimation_samples=fitted)

    def with_channel(self, channel: MeasuredChannel) -> "Experiment":
        """Return the experiment with one more measured channel."""
        return replace(self, channels=(*self.channels, channel))


@dataclass(frozen=True, slots=True, eq=False)
class ExperimentModel:
    """The simulation of an experiment with given effects.

    Attributes
    ----------
    experiment : Experiment
    effects : tuple of Effect
        In the order of the catalogue.
    simulations : tuple of ExtendedSimulator
        One for each channel; only that of the output has effects that are output maps.
    inverse_prior_std : ndarray, shape (parameters,)
        Inverse of the prior standard deviation of each value; 0 if it is free.
    """

    experiment: Experiment
    effects: tuple[Effect, ...]
    simulations: tuple[ExtendedSimulator, ...] = field(init=False)
    inverse_prior_std: Signal = field(init=False)
    _places: tuple[NDArray[np.int64], ...] = field(init=False)

    def __post_init__(self) -> None:
        output, *others = self.experiment.channels
        whole = ExtendedSimulator(output.simulator, self.effects, output.context)
        inner = tuple(effect for effect in self.effects if effect.site != Site.OUTPUT)
        indices = np.arange(len(whole.parameters))
        kept = [indices[whole.simulator_slice], *(indices[whole.get_slice(each)] for each in inner)]
        simulations = [ExtendedSimulator(each.simulator, inner, each.context) for each in others]
        inverse_std, _ = prior_precision(whole, self.experiment.prior_std)
        object.__setattr__(self, "simulations", (whole, *simulations))
        object.__setattr__(self, "inverse_prior_std", inverse_std)
        object.__setattr__(self, "_places", (indices, *(np.concatenate(kept) for _ in others)))

    @property
    def output(self) -> ExtendedSimulator:
        """Simulation of the output."""
        return self.simulations[0]

    def simulate(self, points: Signal) -> Signal:
        """Simulate the estimation part of all channels, and whiten it with their noise.

        All that a plan compares are such data: they are in standard deviations of independent noise.

        Parameters
        ----------
        points : ndarray, shape (points, parameters)

        Returns
        -------
        ndarray, shape (points, channels * estimation samples)
            NaN in every sample of a channel that diverges.
        """
        fitted = self.experiment.estimation_samples
        return np.concatenate(
            [
                channel.noise.whiten(simulation.simulate_batch(points[:, places])[:, :fitted])
                for simulation, places, channel in zip(
                    self.simulations, self._places, self.experiment.channels, strict=True
                )
            ],
            axis=1,
        )

    def insert(self, effect: Effect, point: Sequence[float]) -> Signal:
        """Return the nominal values with those of one effect, shape (parameters,)."""
        values = self.output.nominal
        values[self.output.get_slice(effect)] = self.output.expand(effect, point)
        return values


def make_model(experiment: Experiment, *effects: Effect) -> ExperimentModel:
    """Return the simulation of an experiment with some effects."""
    return ExperimentModel(experiment, catalogue_order(effects))
