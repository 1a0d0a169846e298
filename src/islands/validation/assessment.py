"""Everything that is said about one model: its errors, its residuals, its physics."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import nan

import numpy as np

from islands.data.dataset import Dataset
from islands.data.split import Split
from islands.errors import RecordError
from islands.model.model import Model
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import multiple_shooting
from islands.validation.metrics import InformationCriteria, Metrics, information_criteria, metrics
from islands.validation.physics import PhysicsChecks, check_physics
from islands.validation.residual_tests import ResidualTests, residual_tests

#: Parts of a split and ways to simulate, as they are named in a result.
PARTS = ("estimation", "validation")
MODES = ("one_step_ahead", "multiple_shooting", "free_run")

_NOTHING = Metrics(nan, nan, nan, nan)

#: Residuals that a test of one lag takes.
_FEWEST = 3


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """What is known of a model.

    Attributes
    ----------
    metrics : mapping
        ``metrics[part][mode]``, NaN where that simulation diverged.
    outcomes : mapping
        ``outcomes[part][mode]``.
    information : InformationCriteria
        Of the one-step-ahead residual on the estimation data; NaN where it diverged.
    residual_tests : ResidualTests
        Of the one-step-ahead residual on the longest recording of the validation data; where it diverged
        there, no test passed and each one's note says so.
    physics : PhysicsChecks
    warm_up : int
        Samples before the first prediction of all these simulations: another one would give other errors.
    """

    metrics: Mapping[str, Mapping[str, Metrics]]
    outcomes: Mapping[str, Mapping[str, EvaluationOutcome]]
    information: InformationCriteria
    residual_tests: ResidualTests
    physics: PhysicsChecks
    warm_up: int


def assess(model: Model, split: Split, shooting: int, warm_up: int | None = None) -> Assessment:
    """Assess a model on the data that estimated it and on the data that validates it.

    Parameters
    ----------
    shooting : int
        Samples of an interval of multiple shooting.
    warm_up : int or None
        Samples before the first prediction; None takes the model's deepest lag.

    Raises
    ------
    RecordError
        A part is too short for a prediction, or the validation data for a test of the residual.
    """
    intervals = dict(zip(MODES, (1, shooting, None), strict=True))
    errors: dict[str, dict[str, Metrics]] = {}
    outcomes: dict[str, dict[str, EvaluationOutcome]] = {}
    for part, record in zip(PARTS, (split.estimation, split.validation), strict=True):
        runs = {mode: multiple_shooting(model, record, m, warm_up) for mode, m in intervals.items()}
        outcomes[part] = {mode: run.outcome for mode, run in runs.items()}
        errors[part] = {
            mode: metrics(record.y, run.y) if run.outcome else _NOTHING for mode, run in runs.items()
        }
    return Assessment(
        errors,
        outcomes,
        _information(model, split.estimation, warm_up),
        _residual_tests(model, split.validation, warm_up),
        check_physics(model, split.estimation),
        model.maximum_lag if warm_up is None else warm_up,
    )


def _information(model: Model, record: Dataset, warm_up: int | None) -> InformationCriteria:
    run = multiple_shooting(model, record, 1, warm_up)
    if not run.outcome:
        return InformationCriteria(nan, nan, nan)
    residual = (record.y - run.y)[~np.isnan(run.y)]
    return information_criteria(float(np.add.reduce(residual**2)), len(residual), model.size)


def _residual_tests(model: Model, record: Dataset, warm_up: int | None) -> ResidualTests:
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    recording = record[begin:end]
    first = model.maximum_lag if warm_up is None else warm_up
    samples = recording.samples - first
    if samples < _FEWEST:
        raise RecordError(
            f"the longest recording of the validation data has {recording.samples} samples, of which the "
            f"warm-up takes {first}: testing the residual takes {_FEWEST} more; give a longer recording"
        )
    run = multiple_shooting(model, recording, 1, warm_up)
    # What is known of a diverged prediction is that it is wrong: zeros stand in, and the verdict is given.
    residual = recording.y - run.y if run.outcome else np.zeros(recording.samples)
    tests = residual_tests(residual, recording.u, max_lag=min(25, (samples - 2) // 2) or 1)
    return tests if run.outcome else _failed(tests, f"diverged: {run.outcome.reason}")


def _failed(tests: ResidualTests, why: str) -> ResidualTests:
    entries = tuple(replace(test, passed=False, note=why) for test in tests.tests)
    return ResidualTests(entries, whiteness_p=nan, ljung_box=nan, passed=False)
