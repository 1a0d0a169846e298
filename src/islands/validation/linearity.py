"""Whether a linear model explains a record within its noise, as a fact of an inspection.

The residual of the free run of the best linear model is filtered by its noise model. The tests of
`residual_tests` tell whether what is left depends on the inputs or on the simulated output, on their squares
and on their cubes.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.estimation.linear.identify import find_part, identify_linear
from islands.estimation.linear.model import LinearModel
from islands.estimation.linear.noise import whiten
from islands.progress import Failure, attempt
from islands.records.dataset import Dataset
from islands.records.inspection.fact import Fact
from islands.records.inspection.record_facts import MOST_INPUTS
from islands.records.missing_outputs import skip_missing_outputs
from islands.validation.residual_tests import CorrelationTest, join_probabilities, residual_tests

#: Name of the fact.
LINEAR = "linear"

#: Probability of the tests of a linear process below which it is taken for another one.
_FALSE_ALARM = 1e-3

#: Probability below which it is not stated exactly.
_CERTAIN = 1e-6

#: Part of the power of the residual that follows from its own past, from which on the noise is coloured.
_COLOURED = 0.1


def check_linearity(record: Dataset, *, feedthrough: bool = False) -> Fact:
    """Return whether a linear model explains a record within its noise.

    Parameters
    ----------
    record : Dataset
        Of a long record, a part is taken; missing outputs are skipped.
    feedthrough : bool
        Whether the output responds to an input within the sample.

    Returns
    -------
    Fact
        Its value is None if the record does not show it.
    """
    complete = skip_missing_outputs(record)
    begin, end = find_part(_scale(complete.u).T)
    part = complete[begin:end]
    places = [place for place in range(min(part.inputs, MOST_INPUTS)) if np.ptp(part.u[:, place]) > 0.0]
    if not places or np.ptp(part.y) == 0.0:
        return Fact(LINEAR, "", "linear_constant", details={"output": record.output_name})
    found = attempt(lambda: _check(part, places, feedthrough))
    if isinstance(found, Failure):
        return Fact(LINEAR, "", "not_computed", details={"reason": found.reason})
    return found


def _check(record: Dataset, places: list[int], feedthrough: bool) -> Fact:
    u = record.u[:, places]
    model = identify_linear(u, record.y, record.dt, record.segments, feedthrough=feedthrough)
    counted, residual = np.isfinite(model.residual[0]), model.residual[0]
    simulated = (record.y - residual)[counted]
    columns = _scale(np.column_stack([u[counted], simulated]))
    white = _whiten(model, record)[counted]
    # The squares are those of the tests.
    tests = residual_tests(white, np.column_stack([columns, columns**3])).tests[1:]
    worst = min(tests, key=lambda test: test.probability)
    probability = join_probabilities(worst.probability, len(tests))
    finding = "linear_not" if probability < _FALSE_ALARM else "linear_within"
    error, spread = float(np.std(residual[counted])), float(np.std(record.y))
    details = {
        "output": record.output_name,
        "order": model.order,
        "dead_times": _list_dead_times(model, [record.input_names[place] for place in places]),
        "error": error,
        "output_unit": record.output_unit,
        "share": error / spread,
        "is_certain": probability < _CERTAIN,
        "probability": max(probability, _CERTAIN),
        **_describe_dependence(worst, [*(record.input_names[place] for place in places), record.output_name]),
    }
    if finding == "linear_within" and np.var(white) < (1.0 - _COLOURED) * error**2:
        finding = "linear_disturbed"
    return Fact(LINEAR, "", finding, finding != "linear_not", details=details)


def _scale(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return columns of mean 0 and standard deviation 1, zeros for a constant."""
    spread = columns.std(axis=0)
    return np.asarray((columns - columns.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0), np.float64)


def _whiten(model: LinearModel, record: Dataset) -> NDArray[np.float64]:
    """Return the residual behind the noise model, NaN where it is not counted."""
    white = np.full(record.samples, np.nan)
    for begin, end in record.bounds:
        counted = slice(begin + model.first, end)
        white[counted] = whiten(model.residual[0, counted], model.noise[0])
    return white


def _list_dead_times(model: LinearModel, names: Sequence[str]) -> list[tuple[str, float]]:
    """Return the inputs with a dead time, in seconds."""
    found = [each.value for each in model.quantities[0] if each.name == "dead time"]
    return [(name, value) for name, value in zip(names, found, strict=True) if value > 0.0]


def _describe_dependence(test: CorrelationTest, names: Sequence[str]) -> dict[str, Any]:
    """Return the signal of a test, and whether its amplitude matters: its own correlation is linear."""
    place = test.input or 0
    is_linear = test.name == "u_xi" and place < len(names)
    return {"signal": names[place % len(names)], "depends_on_amplitude": not is_linear}
