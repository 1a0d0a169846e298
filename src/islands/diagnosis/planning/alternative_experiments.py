"""Changes of an experiment that may separate a pair of causes, the cheapest first.

A longer record costs least, since it needs time only. Another input costs more, since the test rig has to
play it. Another channel costs most, since it needs a sensor.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from islands.diagnosis.planning.experiment import Experiment, MeasuredChannel
from islands.diagnosis.planning.pair_separation import CausePair, PairSeparation, separate_pairs
from islands.diagnosis.planning.planned_input import (
    MIN_REPEATS,
    MIN_SAMPLES,
    InputForm,
    InputLimits,
    PlannedInput,
    find_rate,
)
from islands.effects.interface.context import Signal
from islands.expressions.tree import Symbol
from islands.parallel import ParallelMap
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import peak_amplitude
from islands.simulators.ode.simulator import OdeSimulator

#: Factors of the duration of a record.
LENGTH_FACTORS = (2, 4, 8)

#: Factors of the speed of an input.
SPEED_FACTORS = (2, 4, 8, 16)

#: Number of levels at which an input is held.
HOLDS = 12


class Cost(IntEnum):
    """Cost of a change; a larger number is more expensive."""

    NONE = 0
    LENGTH = 1
    INPUT = 2
    CHANNEL = 3


@dataclass(frozen=True, slots=True)
class AlternativeExperiment:
    """A change of an experiment, and the separation of a pair with it.

    Attributes
    ----------
    change : str
    cost : Cost
    separation : PairSeparation
    amplitude, rate : float
        Half of the range of the input, and its largest rate.
    duration : float
        Duration in seconds.
    """

    change: str
    cost: Cost
    separation: PairSeparation
    amplitude: float
    rate: float
    duration: float


def compare_alternatives(
    experiment: Experiment, pair: CausePair, limits: InputLimits, parallel_map: ParallelMap = map
) -> tuple[AlternativeExperiment, ...]:
    """Compare changes of an experiment, the cheapest first and, at equal cost, the better one first.

    Parameters
    ----------
    experiment : Experiment
    pair : CausePair
    limits : InputLimits
        Limits that other inputs stay within.
    """
    changed = list(_list_changes(experiment, limits))
    separations = parallel_map(_PairComparison(pair), [each for _, _, each in changed])
    found = []
    for (cost, change, each), separation in zip(changed, separations, strict=True):
        context = each.context
        size, rate = float(np.ptp(context.u)) / 2, find_rate(context.u, context.dt)
        found.append(AlternativeExperiment(change, cost, separation, size, rate, context.dt * context.u.size))
    return tuple(sorted(found, key=lambda one: (one.cost, one.duration, -one.separation.sufficiency)))


def choose_cheapest(alternatives: Sequence[AlternativeExperiment]) -> AlternativeExperiment | None:
    """Return the cheapest experiment that separates the pair; None if none does."""
    return next((each for each in alternatives if each.separation.sufficiency >= 1.0), None)


@dataclass(frozen=True, slots=True, eq=False)
class _PairComparison:
    pair: CausePair

    def __call__(self, experiment: Experiment) -> PairSeparation:
        return separate_pairs(experiment, [self.pair])[0]


def _list_changes(experiment: Experiment, limits: InputLimits) -> Iterator[tuple[Cost, str, Experiment]]:
    context = experiment.context
    u, dt = context.u, context.dt
    yield Cost.NONE, "as given", experiment
    for factor in LENGTH_FACTORS:
        yield (
            Cost.LENGTH,
            f"the same input {factor} times in a row",
            experiment.with_input(np.tile(u, factor)),
        )
    for change, signal in _list_inputs(u, dt, limits, context.input_unit):
        if limits.contains(signal, dt):
            yield Cost.INPUT, change, experiment.with_input(signal)
    for channel in list_state_channels(experiment):
        unit = f"{channel.noise.std:.2g} {channel.unit}".rstrip()
        yield Cost.CHANNEL, f"measure {channel.name} too, noise {unit}", experiment.with_channel(channel)


def _list_inputs(u: Signal, dt: float, limits: InputLimits, unit: str) -> Iterator[tuple[str, Signal]]:
    samples, places = u.size, np.arange(u.size)
    for factor in SPEED_FACTORS:
        yield f"the same input {factor} times as fast", u[(factor * places) % samples]
    middle, amplitude = (float(np.max(u)) + float(np.min(u))) / 2, float(np.ptp(u)) / 2
    if limits.amplitude > 1.01 * amplitude > 0.0:
        scale = limits.amplitude / amplitude
        yield f"the same input {scale:.3g} times as large", limits.middle + scale * (u - middle)
    hold = max(samples // HOLDS, 1)
    yield f"the same input held every {hold * dt:.3g} s", u[(places // hold) * hold]
    duration = samples * dt
    lowest, highest = 1.0 / duration, 1.0 / (MIN_SAMPLES * dt)
    for share in (0.3, 0.6):
        frequency = lowest * (highest / lowest) ** share
        if frequency * duration < MIN_REPEATS:
            continue
        for form in (InputForm.MULTISINE, InputForm.STEPS):
            excitation = PlannedInput(form, 1.0, frequency, lowest)
            yield excitation.describe(limits, unit), excitation.make(limits, dt, samples)


def list_state_channels(experiment: Experiment) -> tuple[MeasuredChannel, ...]:
    """Return the states of written equations as channels, without the output.

    The noise of a channel has the colour of that of the output, and is the same fraction of its peak.
    """
    output = experiment.channels[0]
    simulator = output.simulator
    if not isinstance(simulator, OdeSimulator):
        return ()
    channels = []
    for state in simulator.system.states:
        if simulator.system.output == Symbol(state.name):
            continue
        inner = replace(simulator, system=replace(simulator.system, output=Symbol(state.name)))
        rough = replace(output.context, output_peak=np.inf)
        simulation = ExtendedSimulator(inner, (), rough)
        peak = peak_amplitude(simulation.simulate(simulation.nominal))
        noise = output.noise.scale(peak / output.context.output_peak)
        context = replace(output.context, output_peak=peak)
        channels.append(MeasuredChannel(state.name, state.unit, inner, context, noise))
    return tuple(channels)
