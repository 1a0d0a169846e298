"""An individual: a vector of trees (genes), each the basis function of one term (equation (10))."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, isnan

from islands.errors import ModelError
from islands.model.expression import Expression
from islands.model.regressor import Regressor, regressor
from islands.simulation.outcome import OK, EvaluationOutcome


@dataclass(frozen=True, slots=True)
class Individual:
    """Genes, and what became of them.

    Attributes
    ----------
    genes : tuple of Expression
        As evolution wrote them, back-shifts and all; after evaluation those that are left.
    regressors : tuple of Regressor
        The terms of the model, in the order of their content; empty before evaluation.
    theta : tuple of float
        Their parameters; empty where the outcome is a failure.
    fitness : float
        Lower is better; infinite before evaluation and after a failure, and where NaN is given: NaN compares
        with nothing, and would win where it came first.
    outcome : EvaluationOutcome
    """

    genes: tuple[Expression, ...]
    regressors: tuple[Regressor, ...] = ()
    theta: tuple[float, ...] = ()
    fitness: float = inf
    outcome: EvaluationOutcome = OK

    def __post_init__(self) -> None:
        if isnan(self.fitness):
            object.__setattr__(self, "fitness", inf)

    @property
    def size(self) -> int:
        """Number of terms of the model."""
        return len(self.regressors)

    @property
    def key(self) -> tuple[str, ...]:
        """The model's structure as text: two individuals with one key are one model."""
        return tuple(item.text for item in self.regressors)


Population = tuple[Individual, ...]


def unique_structures(individuals: Iterable[Individual]) -> Population:
    """Return the first individual of every structure."""
    first: dict[tuple[str, ...], Individual] = {}
    for each in individuals:
        first.setdefault(each.key, each)
    return tuple(first.values())


def make_regressor(gene: Expression) -> Regressor | None:
    """Return a gene's regressor, None where it is identically zero or its numbers overflow."""
    try:
        return regressor(gene)[1]
    except ModelError:
        return None
