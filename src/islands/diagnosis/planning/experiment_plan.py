"""Plan of an experiment: separable causes, changes that separate more, and the decisive experiment."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from islands.diagnosis.calibration.preparation import (
    MIN_SAMPLES,
    validate_prior,
)
from islands.diagnosis.planning.alternative_experiments import AlternativeExperiment, compare_alternatives
from islands.diagnosis.planning.channel_noise import ChannelNoise
from islands.diagnosis.planning.decisive_experiment import DecisiveExperiment, design_experiment
from islands.diagnosis.planning.experiment_setup import make_experiment
from islands.diagnosis.planning.isolability import Isolability, find_isolability
from islands.diagnosis.planning.pair_separation import CausePair
from islands.diagnosis.planning.planned_input import find_limits
from islands.effects.catalogue import EFFECTS
from islands.effects.interface.effect import Effect
from islands.errors import SettingsError, lookup
from islands.parallel import ParallelMap
from islands.progress import ProgressCallback, StoppedError, ignore_progress
from islands.records.dataset import Dataset
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator

#: Maximum number of pairs that an experiment is optimised for, if none is given.
MAX_PAIRS = 8


@dataclass(frozen=True, slots=True)
class DecisiveLimits:
    """Limits of the decisive experiment; None for those of the given input.

    Attributes
    ----------
    amplitude : float or None
        Half of the range of the input, about the middle of the given one.
    rate : float or None
        Largest absolute change per second.
    duration : float or None
        Duration in seconds.
    """

    amplitude: float | None = None
    rate: float | None = None
    duration: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ExperimentPlan:
    """What an experiment can tell apart, before its data are measured.

    Attributes
    ----------
    record : Dataset
        Record with the input. Its output is simulated if it was not given.
    simulation : str
        Name of the simulation.
    noise : ChannelNoise
        Noise of the output.
    isolability : Isolability
    pair : tuple of str
        Names of the causes to be separated; empty if none were given.
    alternatives : tuple of AlternativeExperiment
        Changes of the experiment that may separate the pair, the cheapest first; empty without a pair.
    decisive : DecisiveExperiment or None
        None if there is nothing to be separated: no pair is given, and the experiment separates all causes;
        or if it was left out.
    left_out : tuple of str
        Steps that a request to stop has left out.
    """

    record: Dataset
    simulation: str
    noise: ChannelNoise
    isolability: Isolability
    pair: tuple[str, ...]
    alternatives: tuple[AlternativeExperiment, ...]
    decisive: DecisiveExperiment | None
    left_out: tuple[str, ...] = ()

    @property
    def noise_std(self) -> float:
        """Standard deviation of the noise, in the unit of the output."""
        return self.noise.std


def plan_experiment(
    record: Dataset,
    simulator: Simulator,
    noise_std: float | None = None,
    tolerance: Mapping[str, float] | None = None,
    pair: Sequence[str] = (),
    limits: DecisiveLimits = DecisiveLimits(),
    seed: int = 0,
    parallel_map: ParallelMap = map,
    progress: ProgressCallback = ignore_progress,
    catalogue: Sequence[Effect] = EFFECTS,
) -> ExperimentPlan:
    """Plan an experiment with a simulation: which causes of a discrepancy it could tell apart.

    Parameters
    ----------
    record : Dataset
        Record with the input, and further channels. Its output may be missing.
    simulator : Simulator
    noise_std : float, optional
        Standard deviation of the white noise of the output, in its unit. By default the noise and its colour
        are estimated from the measured output.
    tolerance : mapping, optional
        As in `diagnose`.
    pair : sequence of str
        Names of two effects to be separated; by default all that the experiment cannot tell apart.
    limits : DecisiveLimits
        Limits of the decisive experiment.
    seed : int
        Seed of the decisive experiment.
    parallel_map : ParallelMap
        The result does not depend on it.
    progress : ProgressCallback
        If it or ``parallel_map`` raises `StoppedError` after the causes were compared, the plan ends without
        the other steps.

    Raises
    ------
    RecordError
        The record is too short or has several recordings, the simulation diverges on it, or there is no
        output to estimate the noise from.
    SettingsError
        A setting is not possible, or an effect of the pair is not applicable or not detectable.
    """
    progress("simulating", 0.0)
    prior_std = validate_prior({**simulator.tolerances, **(tolerance or {})}, simulator)
    experiment, effects = make_experiment(record, simulator, noise_std, prior_std, catalogue)
    context = experiment.context
    if np.isnan(record.y).all():
        nominal = ExtendedSimulator(simulator, (), context)
        record = replace(record, y=nominal.simulate(nominal.nominal))
    names = [effect.name for effect in effects]
    _check_pair(pair, names)
    isolability = find_isolability(
        experiment, effects, parallel_map, lambda message, done=None: progress(message, 0.6 * (done or 0.0))
    )
    pairs = [_make_pair(isolability, *pair)] if pair else find_inseparable_pairs(isolability)
    bounds = find_limits(context.u, context.dt, limits.amplitude, limits.rate) if pairs else None
    alternatives: tuple[AlternativeExperiment, ...] = ()
    decisive = None
    left_out = []
    if bounds is not None:
        duration = context.dt * context.u.size if limits.duration is None else limits.duration
        samples = _count_samples(duration, context.dt)
        if pair:
            left_out.append("changes of the experiment")
        left_out.append("decisive experiment")
        with suppress(StoppedError):
            if pair:
                progress("comparing changes of the experiment", 0.6)
                free = replace(bounds, rate=np.inf if limits.rate is None else limits.rate)
                alternatives = compare_alternatives(experiment, pairs[0], free, parallel_map)
                left_out.remove("changes of the experiment")
            decisive = design_experiment(
                *(experiment, pairs, bounds, samples, seed, parallel_map),
                progress=lambda message, done=None: progress(message, 0.7 + 0.3 * (done or 0.0)),
            )
            left_out.clear()
    return ExperimentPlan(
        record,
        simulator.name,
        experiment.noise,
        isolability,
        tuple(pair),
        alternatives,
        decisive,
        tuple(left_out),
    )


def find_inseparable_pairs(isolability: Isolability) -> list[CausePair]:
    """Return pairs that are not separable at the reference misfit in one direction or both.

    Those closest to being separable come first, at most `MAX_PAIRS`.
    """
    misfits = isolability.misfits
    references = [row.reference for row in isolability.rows]
    found = []
    for one, other in combinations(range(len(references)), 2):
        first, second = references[one], references[other]
        if first is None or second is None:
            continue
        excess = max(misfits[one, other] / first.misfit, misfits[other, one] / second.misfit)
        if excess > 1.0:
            found.append((excess, CausePair(first, second)))
    found.sort(key=lambda each: each[0])
    return [pair for _, pair in found[:MAX_PAIRS]]


def _make_pair(isolability: Isolability, one: str, other: str) -> CausePair:
    causes = {name: row.reference for name, row in zip(isolability.names, isolability.rows, strict=True)}
    first, second = causes[one], causes[other]
    for name, cause in ((one, first), (other, second)):
        if cause is None:
            raise SettingsError(
                f"{name} is not detectable with this input at any strength: give another input or tolerances"
            )
    assert first is not None
    assert second is not None
    return CausePair(first, second)


def _check_pair(pair: Sequence[str], names: Sequence[str]) -> None:
    if len(pair) not in (0, 2) or len(set(pair)) != len(pair):
        raise SettingsError(f"two different causes are separated, got {', '.join(pair)}: give two names")
    for name in pair:
        lookup(dict.fromkeys(names), name, "cause of this simulation")


def _count_samples(duration: float, dt: float) -> int:
    samples = round(duration / dt)
    if samples < MIN_SAMPLES:
        raise SettingsError(
            f"{duration:g} s are {samples} samples, and a diagnosis needs at least {MIN_SAMPLES}: give more "
            "seconds"
        )
    return samples
