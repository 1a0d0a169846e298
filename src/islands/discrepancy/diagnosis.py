"""Diagnosis: what a simulation gets wrong, its cause, the simulation with it, and what that is worth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.intersample_selection import same_discretisation, select_intersample
from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult, Target, calibrate
from islands.discrepancy.calibration.preparation import (
    count_fitted_samples,
    make_context,
    select_effects,
    validate_prior,
)
from islands.discrepancy.effects import EFFECTS
from islands.discrepancy.inference.experiment_design import suggest_experiment
from islands.discrepancy.inference.holdout import HoldoutGain, measure_gain
from islands.discrepancy.inference.noise_detectors import DETECTORS
from islands.discrepancy.inference.screening import ScreenedEffect, screen_effects
from islands.discrepancy.inference.stepwise_search import LEAST
from islands.discrepancy.inference.strategies import (
    SearchOutcome,
    assess_evidence,
    best_single,
    search_with_ar_noise,
    search_with_model_error,
)
from islands.discrepancy.inference.verdict import (
    TEMPER,
    Finding,
    Value,
    Verdict,
    describe_effects,
    explained_fraction,
)
from islands.discrepancy.interfaces.effect import Effect, Signal, SimulationContext
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.evolution.progress import ProgressCallback, ignore_progress

#: Times that causes are looked for anew because with them the record asks for another hold or step.
ROUNDS = 3

#: Percent that errors grow by, with 97.5 % certainty, on samples that nothing has seen, before names are
#: withdrawn: a gain that calibration takes up as well changes them by next to nothing, either way.
REFUTED = 0.5


@dataclass(frozen=True, slots=True)
class Candidate:
    """A rung of the first ladder: one effect beside the simulation alone."""

    name: str
    score: float
    explained_fraction: float


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What was found.

    Attributes
    ----------
    verdict : Verdict
    effects : tuple of Finding
        The most important first; empty for "nothing" and "unknown".
    candidates : tuple of Candidate
        All effects beside the simulation, the best first.
    gain : HoldoutGain or None
        On data that nothing else has seen; None where nothing was added to the simulation.
    residual_structure : mapping of str to float
        Maps in which what is left is no chance, with their distance in standard deviations.
    suggested_experiment : str
        What would tell apart what this record cannot; "" where there is nothing to tell apart.
    record : Dataset
    estimation_samples : int
        Samples, from the first on, that estimation has seen; the rest is locked.
    base, best : CalibrationResult
        The simulation calibrated without the effects, and with them.
    noise_floor : float
        RMSE that no simulation is expected to be below.
    is_noise_floor_measured : bool
        The floor is known, from periods that repeat; else it is an upper bound, by what a flexible fit of the
        record foretells: nobody can know it.
    nominal_rmse : float
        RMSE of the simulation with its nominal values over the locked samples.
    """

    verdict: Verdict
    effects: tuple[Finding, ...]
    candidates: tuple[Candidate, ...]
    gain: HoldoutGain | None
    residual_structure: Mapping[str, float]
    suggested_experiment: str
    record: Dataset
    estimation_samples: int
    base: CalibrationResult
    best: CalibrationResult
    noise_floor: float
    is_noise_floor_measured: bool
    nominal_rmse: float


def diagnose(
    record: Dataset,
    simulator: Simulator,
    tolerance: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: ProgressCallback = ignore_progress,
    spread: ParallelMap = map,
    catalogue: Sequence[Effect] = EFFECTS,
) -> Diagnosis:
    """Find out what a simulation gets wrong about a record.

    Parameters
    ----------
    record : Dataset
        Its first input drives the simulation; further ones are channels that may couple in.
    core : Simulator
        The simulation.
    tolerance : mapping, optional
        Relative standard deviations of the simulation's parameters about their nominal values. Who is not
        named is free, and what another value of it mends is no discrepancy.
    seed : int
        Of all that is drawn by lot.
    progress : ProgressCallback
        Told what is being done.
    spread : ParallelMap
        Applies a function to every effect, in parallel or not; the result is the same.
    catalogue : sequence of Effect
        The effects that are searched for.

    Raises
    ------
    RecordError
        The record is too short, has gaps or a signal that does not move, or the simulation diverges on it.
    SettingsError
        A tolerance is not positive or belongs to no parameter of the simulation, two effects have one
        name, or an effect is broken.
    """
    known = validate_prior(tolerance or {}, simulator)
    fitted = count_fitted_samples(record)
    context = make_context(record, simulator, fitted)
    rng = np.random.default_rng(seed)
    simulation = ExtendedSimulator(simulator, (), context)
    target = Target(record.y, np.arange(record.samples) < fitted, None, known)
    progress("calibrating the simulation")
    plain = calibrate(simulation, target, simulation.nominal)
    simulator = select_intersample(plain, target)
    effects = select_effects(simulator, context, known, catalogue)
    for _ in range(ROUNDS):
        plain = calibrate(replace(simulation, simulator=simulator), target, plain.values)
        progress(f"looking for each of {len(effects)} effects")
        rungs = screen_effects(plain, target, effects, spread)
        again = select_intersample(best_single(plain, rungs), target)
        if same_discretisation(again, simulator):
            evidence = search_with_ar_noise(plain, rungs, target, effects, progress, spread)
            again = select_intersample(evidence.hypothesis.fit, evidence.target)
        if same_discretisation(again, simulator):
            break
        # With a cause in it another hold, or a finer step, fits better: it was the cause that hid that.
        progress("once more: the input between its samples")
        simulator = again
    else:
        evidence = search_with_ar_noise(plain, rungs, target, effects, progress, spread)
    progress("what is left over")
    evidence = assess_evidence(evidence, fitted, rng)
    if evidence.verdict == Verdict.UNKNOWN or (
        evidence.verdict == Verdict.NOTHING and evidence.hypothesis.fit.noise.order
    ):
        second = assess_evidence(
            search_with_model_error(plain, target, effects, progress, spread), fitted, rng
        )
        evidence = second if second.verdict != Verdict.UNKNOWN else evidence
    return _told(record, evidence, plain, effects, fitted, rng, progress, spread)


def _told(
    record: Dataset,
    evidence: SearchOutcome,
    plain: CalibrationResult,
    effects: Sequence[Effect],
    fitted: int,
    rng: np.random.Generator,
    progress: ProgressCallback,
    spread: ParallelMap,
) -> Diagnosis:
    """Say what the evidence comes to, and measure the gain: once, on the locked part."""
    base, found, rungs, verdict = evidence.base, evidence.hypothesis, evidence.screened, evidence.verdict
    floor = evidence.noise_floor
    locked = slice(fitted, record.samples)
    gain = None
    if verdict in (Verdict.NAMED, Verdict.REMAINDER):
        gain = measure_gain(record, plain.output, found.fit.output, locked, floor**0.5, rng)
        if found.effects and gain.ci95[1] < -REFUTED:
            # What nothing has seen speaks against it: there is something, but it is not this.
            gain, verdict = None, Verdict.UNKNOWN
    named: tuple[Finding, ...] = ()
    instead: tuple[ScreenedEffect, ...] = ()
    if gain is not None:
        progress("what else could be the cause")
        named, instead = describe_effects(found, base, rungs, evidence.target, effects, floor, spread)
    residual = (record.y - found.fit.output)[:fitted]
    context = found.fit.simulation.context
    noise = _noise(record.y[:fitted], residual, context) if verdict != Verdict.UNKNOWN else ()
    simulation = plain.simulation
    given = simulation.simulate(simulation.nominal)
    best = found.fit if named else plain
    return Diagnosis(
        Verdict.NAMED if noise and verdict == Verdict.NOTHING else verdict,
        (*named, *noise),
        tuple(
            Candidate(r.effect.cause, r.score_gain(base), explained_fraction(base, r.fit, floor))
            for r in rungs
        ),
        gain,
        evidence.residual_structure,
        suggest_experiment(found.fit, instead),
        record,
        fitted,
        plain,
        best,
        floor**0.5,
        evidence.is_noise_floor_measured,
        float(np.sqrt(np.mean((record.y - given)[locked] ** 2))),
    )


def _noise(y: Signal, residual: Signal, context: SimulationContext) -> tuple[Finding, ...]:
    """Name what sampling and noise have done, the crudest first: what it explains is not blamed on others."""
    found: list[Finding] = []
    for detector in DETECTORS.values():
        if any(each.name in detector.excluded_by for each in found):
            continue
        detection = detector.detect(y, residual, context)
        if detection is not None and detection.score_gain > LEAST:
            values = {name: Value(value, unit, None) for name, (value, unit) in detection.parameters.items()}
            sure = 1.0 / (1.0 + float(np.exp(-detection.score_gain / (2 * TEMPER))))
            found.append(
                Finding(detector.name, detector.family, sure, (), values, detection.score_gain, None)
            )
    return tuple(found)


@dataclass(frozen=True, slots=True)
class ResidualFormula:
    """A formula for what the best simulation leaves over.

    Attributes
    ----------
    formula : str
        Of the residual, measured minus simulated, in free run: it reads its own past, the input and the
        simulated output.
    explains : float
        Fraction of the remainder's mean square that the formula predicts over the locked samples.
    """

    formula: str
    explains: float
