"""Findings of a diagnosis while it runs, from which a stopped one makes its result."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from islands.diagnosis.assembly import make_diagnosis
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.diagnosis.calibration.starts_calibrator import (
    CalibratedStart,
    CalibrationTask,
    StartsCalibrator,
    calibrate_all,
)
from islands.diagnosis.calibration.target import Target
from islands.diagnosis.discovery.missing_terms import MissingTerms
from islands.diagnosis.gross_errors.record_finding import RecordFinding
from islands.diagnosis.inference.hypothesis import Hypothesis
from islands.diagnosis.inference.screening import ScreenedEffect
from islands.diagnosis.inference.strategies import SearchOutcome, analyse_residual, make_outcome
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.noise_claim import complete_findings
from islands.diagnosis.result import Diagnosis
from islands.diagnosis.run import DiagnosisRun
from islands.effects.interface.effect import Effect
from islands.parallel import ParallelMap, intercepted_map
from islands.progress import explain_failure
from islands.records.dataset import Dataset

#: Steps of a diagnosis after the calibration of the simulation, in their order.
STEPS = (
    GROSS_ERRORS := "gross errors of the record",
    SCREENING := "screening of the effects",
    COMBINATIONS := "combinations of effects",
    EVIDENCE := "tests of the evidence",
    MODEL_ERROR := "search with model error",
    FREE_FORMS := "comparison with free forms",
    MISSING_TERMS := "search for missing terms",
    ALTERNATIVES := "alternative causes",
    EXTENSION := "extension by missing terms",
)


class InterimFindings:
    """Findings of a diagnosis up to its current step.

    `diagnose` keeps them. If an exception ends it, such as `KeyboardInterrupt`, the caller gets the result so
    far from `make_diagnosis`.

    Parameters
    ----------
    on_found : callable
        Called with the named causes, before the last step.
    """

    def __init__(self, on_found: Callable[[Diagnosis], object] = lambda _found: None) -> None:
        self._on_found = on_found
        self._begun: (
            tuple[Dataset, CalibrationResult, Target, Sequence[RecordFinding], float | None] | None
        ) = None
        self._fits: _ScreeningFits | None = None
        self._screened: tuple[CalibrationResult, Sequence[ScreenedEffect]] | None = None
        self._assessed: tuple[CalibrationResult, SearchOutcome, Sequence[Effect]] | None = None
        self._terms: MissingTerms | None = None
        self._found: Diagnosis | None = None
        self._step: str | None = GROSS_ERRORS

    def begin(
        self,
        record: Dataset,
        base: CalibrationResult,
        target: Target,
        record_findings: Sequence[RecordFinding],
        noise_level: float | None = None,
    ) -> None:
        """Keep the calibrated simulation, the first result of a diagnosis; arguments as of `diagnose`."""
        self._begun = record, base, target, record_findings, noise_level

    def record_screening(self, base: CalibrationResult, parallel_map: ParallelMap) -> ParallelMap:
        """Return a map that keeps the fits of the first screening while it runs."""
        if self._screened is not None:
            return parallel_map
        self._step, self._fits = SCREENING, _ScreeningFits(base)
        return self._fits.record(parallel_map)

    def keep_screening(self, base: CalibrationResult, screened: Sequence[ScreenedEffect]) -> None:
        """Keep the screened effects; combinations of them are searched for."""
        self._screened, self._step = (base, screened), COMBINATIONS

    def reach(self, step: str) -> None:
        """Note that one of `STEPS` begins."""
        self._step = step

    def keep_outcome(
        self, base: CalibrationResult, outcome: SearchOutcome, effects: Sequence[Effect], step: str
    ) -> SearchOutcome:
        """Keep the outcome of a search whose evidence was tested, and return it.

        Parameters
        ----------
        base, outcome, effects
            Arguments of `diagnosis_assembly.make_diagnosis`.
        step : str
            Step that begins.
        """
        self._assessed, self._step = (base, outcome, effects), step
        return outcome

    def keep_terms(self, terms: MissingTerms | None) -> None:
        """Keep the missing terms; alternative causes are screened."""
        self._terms, self._step = terms, ALTERNATIVES

    def keep_diagnosis(self, found: Diagnosis) -> Diagnosis:
        """Keep the diagnosis without the last step, and return it."""
        self._found, self._step = found, EXTENSION
        self._on_found(found)
        return found

    def complete(self, found: Diagnosis) -> Diagnosis:
        """Keep the complete diagnosis, and return it."""
        self._found, self._step = found, None
        return found

    def make_diagnosis(self, seed: int = 0) -> Diagnosis | None:
        """Make the result so far, without further calibrations of effects.

        Its verdict is that of the last search whose evidence was tested, and "stopped" before.

        Parameters
        ----------
        seed : int
            Seed of the random generator.

        Returns
        -------
        Diagnosis or None
            None if the simulation has not been calibrated. A complete diagnosis is returned as it is.
        """
        if self._step is None or self._begun is None:
            return self._found
        record, base, target, record_findings, noise_level = self._begun
        rng = np.random.default_rng(seed)
        left_out = list(STEPS[STEPS.index(self._step) :])
        if self._found is not None:
            found = self._found
        elif self._assessed is not None and _has_alternatives(self._assessed[1]):
            base, outcome, effects = self._assessed
            left_out.remove(ALTERNATIVES)
            found = make_diagnosis(record, outcome, base, self._terms, DiagnosisRun(effects, rng))
        else:
            screened: Sequence[ScreenedEffect] = ()
            if self._screened is not None:
                base, screened = self._screened
            elif self._fits is not None:
                base, screened = self._fits.base, self._fits.rank()
                if self._step == SCREENING:
                    left_out[0] = f"{SCREENING} ({len(screened)} are screened)"
            outcome = _make_outcome(base, screened, target, rng)
            found = make_diagnosis(record, outcome, base, None, DiagnosisRun((), rng))
        fit = base if target.has_feedback else found.best
        found = complete_findings(found, fit, target, record_findings, noise_level, rng)
        return replace(found, left_out=tuple(left_out))

    def fail(self, error: Exception, seed: int = 0) -> Diagnosis | None:
        """Make the result so far of a diagnosis with a step that fails; see `make_diagnosis`."""
        found = self.make_diagnosis(seed)
        if found is None:
            return None
        steps = ", ".join(found.left_out)
        return replace(found, left_out=(), not_computed={steps: explain_failure(error)})


class _ScreeningFits:
    """Rough fits of single effects, in the order in which a screening makes them."""

    def __init__(self, base: CalibrationResult) -> None:
        self.base = base
        self._calibrator: StartsCalibrator | None = None
        self._ended: list[tuple[CalibrationTask, list[CalibratedStart]]] = []

    def record(self, parallel_map: ParallelMap) -> ParallelMap:
        """Return a map that keeps rough calibrations."""

        def keep(
            calibrator: StartsCalibrator, tasks: Sequence[CalibrationTask]
        ) -> Iterator[list[CalibratedStart]]:
            if not calibrator.is_rough:
                yield from parallel_map(calibrator, tasks)
                return
            self._calibrator = calibrator
            for task, ends in zip(tasks, parallel_map(calibrator, tasks), strict=True):
                self._ended.append((task, ends))
                yield ends

        return intercepted_map(parallel_map, StartsCalibrator, keep)

    def rank(self) -> list[ScreenedEffect]:
        """Return the screened effects, the best first."""
        if self._calibrator is None:
            return []
        tasks, ends = [task for task, _ in self._ended], [each for _, each in self._ended]
        fits = calibrate_all(self._calibrator, tasks, lambda _function, _tasks: iter(ends))  # type: ignore[arg-type]
        screened = [ScreenedEffect(fit.simulation.effects[-1], fit) for fit in fits]
        return sorted(screened, key=lambda each: -each.score_gain(self.base))


def _has_alternatives(outcome: SearchOutcome) -> bool:
    """Return whether the causes of an outcome can be described: with several, each has alternatives."""
    return len(outcome.hypothesis.effects) < 2 or bool(outcome.hypothesis.alternatives)


def _make_outcome(
    base: CalibrationResult,
    screened: Sequence[ScreenedEffect],
    target: Target,
    rng: np.random.Generator,
) -> SearchOutcome:
    """Return the outcome of a search that was stopped before a verdict."""
    rest = analyse_residual(base, target, rng)
    return replace(
        make_outcome(base, screened, target, Hypothesis(base, base.score, ())),
        noise_floor=rest.noise_floor,
        is_noise_floor_measured=rest.is_noise_floor_measured,
        residual_structure=rest.structure,
        verdict=Verdict.STOPPED,
    )
