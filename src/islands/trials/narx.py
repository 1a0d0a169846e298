"""A NARX model of an actuator, identified on the record that something is hidden in."""

from islands.data.dataset import Dataset
from islands.errors import RecordError
from islands.estimation.estimation import estimate
from islands.estimation.refinement import refine
from islands.model.expression import Apply, Expression, Lagged
from islands.model.model import Model
from islands.model.primitives import MUL, PRIMITIVES
from islands.model.regressor import Regressor, regressor
from islands.simulation.outcome import Outcome

#: The constraint under which it holds still where its input does.
_CONSTRAINT = "hysteresis"


def identified(record: Dataset) -> Model:
    """Identify increments of the output by those of the input, their size and sign, and levels.

    The structure is fixed: what an increment of a Bouc-Wen actuator is made of, the levels up to the second
    degree. A second increment takes the first one on to the present, which a model may not read. Parameters
    are estimated one step ahead and refined in free run.

    Raises
    ------
    RecordError
        No such model can be estimated on this record.
    """
    found = estimate(_structure(), record, _CONSTRAINT)
    if isinstance(found, Outcome):
        raise RecordError(f"no NARX model of this structure can be estimated: {found}")
    refined = refine(found.model, record, None, _CONSTRAINT)
    return found.model if isinstance(refined, Outcome) else refined.model


def _structure() -> list[Regressor]:
    y, u = Lagged(0, 1), Lagged(1, 1)
    increments = [Apply(PRIMITIVES["phi1"], (Lagged(1, lag), Lagged(1, lag + 1))) for lag in (1, 2)]
    direction = Apply(PRIMITIVES["phi2"], (Lagged(1, 1), Lagged(1, 2)))

    def product(*factors: Expression) -> Expression:
        return Apply(MUL, factors)

    size = product(direction, increments[0])
    expressions = [y, *increments, product(size, u), product(size, y)]
    expressions += [product(increments[0], *levels) for levels in ((u, u), (u, y), (y, y))]
    return [item for _, item in map(regressor, expressions) if item is not None]
