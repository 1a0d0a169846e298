"""Decisive experiment: the input within limits that separates causes best."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from islands.diagnosis.planning.experiment import Experiment
from islands.diagnosis.planning.pair_separation import (
    CausePair,
    PairSeparation,
    rate_separations,
    separate_pairs,
)
from islands.diagnosis.planning.planned_input import (
    MIN_REPEATS,
    MIN_SAMPLES,
    InputForm,
    InputLimits,
    PlannedInput,
)
from islands.effects.interface.context import Signal
from islands.parallel import ParallelMap
from islands.progress import ProgressCallback, ignore_progress

#: Forms of the input that are optimised.
FORMS = (InputForm.MULTISINE, InputForm.STEPS)

#: Inputs per generation of the differential evolution, for each of the three parameters of a form.
_POPULATION = 4

#: Generations of the differential evolution.
GENERATIONS = 4

#: Maximum number of evaluations of each fit during the optimisation.
_ROUGH_EVALUATIONS = 4

#: Smallest amplitude as a fraction of that of the limits.
_MIN_SHARE = 0.1


@dataclass(frozen=True, slots=True, eq=False)
class DecisiveExperiment:
    """The input that separates pairs of causes best.

    Attributes
    ----------
    description : str
    u : ndarray, shape (samples,)
    dt : float
        Sampling time in seconds.
    pairs : tuple of CausePair
    before, after : tuple of PairSeparation
        Separations of the pairs by the given input and by this one.
    """

    description: str
    u: Signal
    dt: float
    pairs: tuple[CausePair, ...]
    before: tuple[PairSeparation, ...]
    after: tuple[PairSeparation, ...]


def design_experiment(
    experiment: Experiment,
    pairs: Sequence[CausePair],
    limits: InputLimits,
    samples: int,
    seed: int = 0,
    parallel_map: ParallelMap = map,
    progress: ProgressCallback = ignore_progress,
) -> DecisiveExperiment:
    """Find the input that separates pairs of causes best.

    Frequencies and amplitude of each form of input are found by differential evolution (Storn and Price,
    1997). A single pair is separated as far as possible. Of several pairs as many as possible are separated,
    and the others as far as possible: some pairs have the same response to every input.

    Parameters
    ----------
    experiment : Experiment
        The experiment with the given input.
    pairs : sequence of CausePair
    limits : InputLimits
    samples : int
        Number of samples of the input.
    seed : int
        Seed of the optimisation and of the phases and levels.
    parallel_map : ParallelMap
        Evaluates the inputs of a generation.
    """
    dt = experiment.context.dt
    lowest, highest = 1.0 / (samples * dt), 1.0 / (MIN_SAMPLES * dt)
    bounds = [(_MIN_SHARE, 1.0), (np.log(MIN_REPEATS * lowest), np.log(highest)), (0.0, 0.9)]
    candidates = []
    for index, form in enumerate(FORMS):
        score = _InputScore(experiment, tuple(pairs), limits, samples, form, seed)
        generation = 0

        def update(*_: object, index: int = index, form: InputForm = form) -> None:
            nonlocal generation
            generation += 1
            done = (index + generation / GENERATIONS) / len(FORMS)
            progress(f"optimising the {form} input", min(done, 1.0))

        best = scipy.optimize.differential_evolution(
            score,
            bounds,
            popsize=_POPULATION,
            maxiter=GENERATIONS,
            rng=np.random.default_rng([seed, index]),
            polish=False,
            updating="deferred",
            workers=lambda function, points: list(parallel_map(function, points)),
            callback=update,
        )
        candidates.append(score.make_excitation(best.x))
    before = separate_pairs(experiment, pairs)
    found = []
    for excitation in candidates:
        u = excitation.make(limits, dt, samples)
        after = separate_pairs(experiment.with_input(u), pairs)
        found.append((rate_separations(after), excitation, u, after))
    _, excitation, u, after = max(found, key=lambda each: each[0])
    description = excitation.describe(limits, experiment.context.input_unit)
    return DecisiveExperiment(description, u, dt, tuple(pairs), before, after)


@dataclass(frozen=True, slots=True, eq=False)
class _InputScore:
    """Function of the parameters of an input that is less for a better separation."""

    experiment: Experiment
    pairs: tuple[CausePair, ...]
    limits: InputLimits
    samples: int
    form: InputForm
    seed: int

    def make_excitation(self, point: Signal) -> PlannedInput:
        """Return the input with an amplitude, a log frequency and the relative width of its band."""
        share, log_frequency, position = map(float, point)
        frequency, longest = float(np.exp(log_frequency)), 1.0 / (self.samples * self.experiment.context.dt)
        lowest = longest * (frequency / longest) ** position
        return PlannedInput(self.form, share, frequency, lowest, self.seed)

    def __call__(self, point: Signal) -> float:
        u = self.make_excitation(point).make(self.limits, self.experiment.context.dt, self.samples)
        changed = self.experiment.with_input(u)
        return -rate_separations(separate_pairs(changed, self.pairs, _ROUGH_EVALUATIONS))
