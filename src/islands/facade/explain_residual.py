"""`explain_residual`: search for a formula of the part of a residual that no effect explains."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.inference.verdict import Verdict
from islands.diagnosis.result import Diagnosis
from islands.progress import ProgressCallback, Stop, ignore_progress, never_stop
from islands.records.dataset import Dataset
from islands.rounding import ROUNDING
from islands.simulation.predictors import free_run

if TYPE_CHECKING:
    from islands.evolution.engine import Engine
    from islands.evolution.search_state import SearchState
    from islands.evolution.settings import Settings
    from islands.facade.engine_choice import Ray
    from islands.facade.evolution_run import SearchCallback

#: Name of this step of a diagnosis.
FORMULA = "a formula for the unexplained residual"

#: Fractions of a diagnosis at which this step and the report begin. In six diagnoses of 15 to 80 s, they took
#: up to 9 % and 2 to 17 %.
BEFORE_FORMULA, BEFORE_REPORT = 0.92, 0.955

#: Settings of the search: few terms, so that the formula is readable.
SEARCH: Mapping[str, Any] = MappingProxyType(
    {
        "population": 200,
        "generations": 40,
        "islands": 2,
        "max_terms": 5,
        "initial_terms": (1, 5),
        # The formula is simulated at the sampling time of the diagnosis.
        "average": 1,
        "feedthrough": "no",
    }
)

#: Fraction of the residual, on the hold-out part, that a formula has to exceed by `MIN_IMPROVEMENT`.
MIN_EXPLAINED_FRACTION = 0.1

#: Increase of that fraction for which a model replaces one with a smaller validation error.
MIN_IMPROVEMENT = 0.02

#: Name of the residual in a formula.
RESIDUAL = "residual"

#: Name of the simulated output in a formula.
SIMULATED = "simulated"


class FormulaProgress:
    """Progress of this step of a diagnosis, from the generations of its search."""

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None

    def measure(self, state: "SearchState", settings: "Settings", now: float) -> tuple[float, float | None]:
        """Measure the progress at the end of an epoch.

        Parameters
        ----------
        state, settings
            Arguments of a callback of the search, which may continue another one.
        now : float
            Time in seconds by the clock of the caller.

        Returns
        -------
        float
            Completed fraction of the diagnosis.
        float or None
            Seconds that the search still takes; None at its first state.
        """
        done = state.archipelago.generation / settings.generations
        fraction = BEFORE_FORMULA + (BEFORE_REPORT - BEFORE_FORMULA) * done
        began, before = self._first = self._first or (now, done)
        return fraction, (now - began) * (1.0 - done) / (done - before) if done > before else None


def explain_residual(
    found: Diagnosis,
    seed: int = 0,
    engine: "Engine | Ray | str | None" = None,
    progress: ProgressCallback = ignore_progress,
    on_epoch: "SearchCallback | None" = None,
    stop: Stop = never_stop,
    start: "SearchState | None" = None,
) -> ResidualFormula | None:
    """Search for a formula of the residual of the best simulation of a diagnosis.

    The search uses the estimation part of the record; the hold-out part decides which formula is returned.

    Parameters
    ----------
    found : Diagnosis
    seed, engine, progress, on_epoch, stop, start
        Arguments of `identify`; ``start`` is a state of the search for the same residual.

    Returns
    -------
    ResidualFormula or None
        None if the verdict leaves no unexplained residual, if it is rounding error, or if no formula
        explains enough of it.
    """
    if found.verdict not in (Verdict.UNKNOWN, Verdict.REMAINDER):
        return None
    record = found.record
    residual = record.y - found.best.output
    is_known = ~np.isnan(residual)
    if np.sqrt(np.mean(residual[is_known] ** 2)) <= ROUNDING * record.output_range:
        return None
    # Most diagnoses search for no formula.
    from islands.facade.identify import identify_record  # noqa: PLC0415

    dataset = Dataset(
        u=np.column_stack([record.u[:, 0], found.best.output]),
        y=residual,
        dt=record.dt,
        input_names=(record.input_names[0], SIMULATED),
        input_units=(record.input_units[0], record.output_unit),
        output_name=RESIDUAL,
        output_unit=record.output_unit,
        segments=record.segments,
        recordings=record.recordings,
    )
    result = identify_record(
        dataset[: found.estimation_samples],
        preset="narx",
        seed=seed,
        engine=engine,
        progress=progress,
        on_epoch=on_epoch,
        stop=stop,
        start=start,
        **SEARCH,
    )
    best, explained = None, MIN_EXPLAINED_FRACTION
    for each in result.models:
        run = free_run(each.model, dataset)
        is_judged = is_known & (np.arange(record.samples) >= found.estimation_samples)
        error = np.where(np.isfinite(run.y), residual - run.y, residual)[is_judged]
        total = float(np.sum(residual[is_judged] ** 2))
        fraction = 1.0 - float(np.sum(error**2)) / total if total else 0.0
        # Models are in the order of their validation error: a later one has to explain clearly more.
        if fraction > explained + MIN_IMPROVEMENT:
            best, explained = each.model, fraction
    if best is None:
        return None
    return ResidualFormula(best.equation().named, explained)
