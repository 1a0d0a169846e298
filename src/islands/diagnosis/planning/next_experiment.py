"""Next experiment: the input that separates the explanations which a record does not tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil

import numpy as np

from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.inference.screening import ScreenedEffect
from islands.diagnosis.planning.candidate_inputs import (
    CandidateInput,
    find_excess,
    list_inputs_beyond,
    list_inputs_within,
)
from islands.diagnosis.planning.explanation import ExplanationPair, pair_explanations, take_longest_input
from islands.diagnosis.planning.noise_free_fit import MAX_EVALUATIONS
from islands.diagnosis.planning.pair_separation import PairSeparation, rate_separations
from islands.diagnosis.planning.planned_input import InputLimits, find_rate
from islands.effects.interface.context import Signal
from islands.parallel import ParallelMap
from islands.records.dataset import Dataset

#: Maximum number of samples of the input, and of the record with which it is compared.
MAX_SAMPLES, MAX_RECORDED_SAMPLES = 5_000, 20_000

#: Maximum number of pairs that the input is designed for; those with the best alternatives come first.
MAX_PAIRS = 4

#: Maximum number of evaluations of each fit with which candidates are compared.
_ROUGH_EVALUATIONS = 2

#: Number of the best candidates within the record, and beyond it, that are compared with complete fits.
_COMPARED = 2

#: Largest number of repetitions of an experiment that is advised.
MAX_REPEATS = 100


@dataclass(frozen=True, slots=True)
class SeparatedPair:
    """Two causes that a record does not tell apart, and their separation by an experiment.

    Distances are those of the outputs that both causes predict, after each was calibrated to that of the
    other, in standard deviations of the noise.

    Attributes
    ----------
    causes : tuple of str
    recorded : PairSeparation or None
        With the input of the record; None if no input can be simulated.
    predicted : PairSeparation or None
        With the designed one; None if there is none.
    """

    causes: tuple[str, str]
    recorded: PairSeparation | None
    predicted: PairSeparation | None

    @property
    def repeats(self) -> int | None:
        """Number of runs that separate the causes; None if they are more than `MAX_REPEATS`.

        Squared distances of independent runs add up.
        """
        if self.predicted is None or self.predicted.sufficiency**2 * MAX_REPEATS < 1.0:
            return None
        return max(ceil(self.predicted.sufficiency**-2), 1)


@dataclass(frozen=True, slots=True, eq=False)
class DesignedInput:
    """The input of an experiment, with the limits of the record that it is compared with.

    Attributes
    ----------
    description : str
    u : ndarray, shape (samples,)
    dt : float
        Sampling time in seconds, that of the record.
    name, unit : str
        Name of the input in the record, and its unit.
    recorded : InputLimits
        Range and largest rate of the recorded input.
    """

    description: str
    u: Signal
    dt: float
    name: str
    unit: str
    recorded: InputLimits

    @property
    def duration(self) -> float:
        """Duration in seconds."""
        return self.dt * self.u.size

    @property
    def limits(self) -> InputLimits:
        """Range and largest rate of the input."""
        return InputLimits(float(np.min(self.u)), float(np.max(self.u)), find_rate(self.u, self.dt))

    @property
    def excess(self) -> tuple[float, float]:
        """Factors by which it exceeds the range and the rate of the record; 1 within them."""
        return find_excess(self.u, self.dt, self.recorded)

    @property
    def is_within(self) -> bool:
        """Whether it is within the range and the rate of the record."""
        return self.recorded.contains(self.u, self.dt)


@dataclass(frozen=True, slots=True, eq=False)
class NextExperiment:
    """Experiment that separates explanations which a record does not tell apart.

    Attributes
    ----------
    pairs : tuple of SeparatedPair
    input : DesignedInput or None
        None if the simulation predicts no other input, or no candidate separates any pair.
    """

    pairs: tuple[SeparatedPair, ...]
    input: DesignedInput | None


def design_next_experiment(
    record: Dataset,
    best: CalibrationResult,
    alternatives: Sequence[ScreenedEffect],
    target: Target,
    parallel_map: ParallelMap = map,
) -> NextExperiment | None:
    """Choose the input that separates the best explanation of a record most from its alternatives.

    Candidates are holds, a slow triangle wave, a sweep, multisines and a smaller input, all within the range
    and the rate of the record. Inputs beyond them are chosen only if they separate more pairs, and then the
    one that exceeds the record least. The result depends on the arguments alone.

    Parameters
    ----------
    record : Dataset
    best : CalibrationResult
        Simulation with the named causes.
    alternatives : sequence of ScreenedEffect
        Causes that the record does not tell apart from one of them, the best first.
    target : Target
        Measured output.
    parallel_map : ParallelMap
        Compares the candidates.

    Returns
    -------
    NextExperiment or None
        None if there are no alternatives, or the residual is not above rounding.
    """
    given = [(each.effect, each.fit) for each in alternatives[:MAX_PAIRS]]
    pairs = pair_explanations(best, given, target)
    if not pairs:
        return None
    simulator = best.simulation.simulator
    context = best.simulation.context
    u = take_longest_input(context.u, context.segments, MAX_SAMPLES)
    names = [pair.names for pair in pairs]
    if simulator.is_recorded or simulator.fits_states or np.ptp(context.u) == 0.0:
        return NextExperiment(tuple(SeparatedPair(each, None, None) for each in names), None)
    rate = float(np.max(np.abs(context.take_differences(context.u)))) / record.dt
    limits = InputLimits(float(np.min(context.u)), float(np.max(context.u)), rate)
    chosen, after = _choose_input(pairs, u, record.dt, limits, context.input_unit, parallel_map)
    recorded = take_longest_input(context.u, context.segments, MAX_RECORDED_SAMPLES)
    before = [pair.separate(recorded) for pair in pairs]
    separated = tuple(map(SeparatedPair, names, before, after))
    if all(each.repeats is None for each in separated):
        return NextExperiment(separated, None)
    designed = DesignedInput(
        chosen.description, chosen.u, record.dt, record.input_names[0], record.input_units[0], limits
    )
    return NextExperiment(separated, designed)


def _choose_input(
    pairs: Sequence[ExplanationPair],
    u: Signal,
    dt: float,
    limits: InputLimits,
    unit: str,
    parallel_map: ParallelMap,
) -> tuple[CandidateInput, list[PairSeparation]]:
    """Return the candidate that separates most, with its separations."""

    def find_rough(candidates: Sequence[CandidateInput]) -> list[list[PairSeparation]]:
        return list(parallel_map(partial(_separate_all, pairs, evaluations=_ROUGH_EVALUATIONS), candidates))

    within = list_inputs_within(u, dt, limits, unit)
    rough = find_rough(within)
    order = sorted(range(len(within)), key=lambda place: -rate_separations(rough[place]))
    best, after = max(
        ((within[place], _separate_all(pairs, within[place])) for place in order[:_COMPARED]),
        key=lambda each: rate_separations(each[1]),
    )
    count = _count_separated(after)
    if count == len(pairs):
        return best, after
    beyond = list_inputs_beyond(u, dt, limits, unit)
    promising = [
        (-_count_separated(separations), max(find_excess(each.u, dt, limits)), place)
        for place, (each, separations) in enumerate(zip(beyond, find_rough(beyond), strict=True))
        if _count_separated(separations) > count
    ]
    for *_, place in sorted(promising)[:_COMPARED]:
        if _count_separated(separations := _separate_all(pairs, beyond[place])) > count:
            return beyond[place], separations
    return best, after


def _count_separated(separations: Sequence[PairSeparation]) -> int:
    return sum(each.sufficiency >= 1.0 for each in separations)


def _separate_all(
    pairs: Sequence[ExplanationPair], candidate: CandidateInput, evaluations: int = MAX_EVALUATIONS
) -> list[PairSeparation]:
    return [pair.separate(candidate.u, evaluations) for pair in pairs]
