"""Individual: a vector of trees (genes), each the basis function of one term (equation (10))."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from math import inf, isnan
from typing import TYPE_CHECKING, ClassVar, TypeAlias, TypeVar

from islands.errors import ModelError
from islands.expressions.tree import Expression
from islands.models.regressor import CanonicalForms, Regressor, regressor
from islands.simulation.outcome import OK, EvaluationOutcome

if TYPE_CHECKING:
    # At run time it would load the kernels of its estimation into every command that reads settings.
    from islands.estimation.fitted_state_space import FittedStateSpace


@dataclass(frozen=True, slots=True)
class Individual:
    """Genes and their evaluation.

    Attributes
    ----------
    genes : tuple of Expression
        Trees with their back-shifts; after evaluation, only the genes that remain.
    regressors : tuple of Regressor
        Terms of the model, ordered by content; empty before evaluation.
    theta : tuple of float
        Parameters of the terms; empty if the outcome is a failure.
    fitness : float
        Lower is better. Infinite before evaluation and after a failure. NaN is replaced by infinity, because
        NaN compares as false and would win if it came first.
    outcome : EvaluationOutcome
    """

    #: Individuals of every size in a hall of fame; validation selects among them.
    kept: ClassVar[int] = 8

    genes: tuple[Expression, ...]
    regressors: tuple[Regressor, ...] = ()
    theta: tuple[float, ...] = ()
    fitness: float = inf
    outcome: EvaluationOutcome = OK
    _key: tuple[str, ...] | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if isnan(self.fitness):
            object.__setattr__(self, "fitness", inf)

    @property
    def size(self) -> int:
        """Number of terms of the model."""
        return len(self.regressors)

    @property
    def key(self) -> tuple[str, ...]:
        """Structure of the model as text; equal keys mean equal structures."""
        key = self._key
        if key is None:
            # Elite, hall of fame and statistics of every generation compare the keys of all individuals.
            key = tuple([item.text for item in self.regressors])
            object.__setattr__(self, "_key", key)
        return key

    @property
    def niche(self) -> tuple[str, ...]:
        """Terms of the model as text without lags: individuals of one niche differ only in their lags."""
        return tuple(sorted(_erase_lags(item.text) for item in self.regressors))


Population: TypeAlias = tuple[Individual, ...]

#: Individual of any class of models.
AnyIndividual: TypeAlias = "Individual | FittedStateSpace"
AnyPopulation: TypeAlias = "tuple[AnyIndividual, ...]"

_Kind = TypeVar("_Kind", bound=AnyIndividual)


def unique_structures(individuals: Iterable[_Kind]) -> tuple[_Kind, ...]:
    """Return the first individual of every structure."""
    return _keep_first((each.key, each) for each in individuals)


def unique_niches(individuals: Iterable[_Kind]) -> tuple[_Kind, ...]:
    """Return the first individual of every niche."""
    return _keep_first((each.niche, each) for each in individuals)


def _keep_first(labelled: Iterable[tuple[tuple[str, ...], _Kind]]) -> tuple[_Kind, ...]:
    first: dict[tuple[str, ...], _Kind] = {}
    for label, each in labelled:
        first.setdefault(label, each)
    return tuple(first.values())


@lru_cache(1 << 14)
def _erase_lags(text: str) -> str:
    return re.sub(r"\(k-\d+\)", "(k)", text)


def require_genes(individual: AnyIndividual) -> Individual:
    """Return an individual that is a vector of genes.

    Raises
    ------
    ModelError
        It is a state space.
    """
    if not isinstance(individual, Individual):
        raise ModelError(
            "the individual is a state space and has no genes: pass one of a search for NARX models"
        )
    return individual


def make_regressor(gene: Expression, known: CanonicalForms | None = None) -> Regressor | None:
    """Return the regressor of a gene; None if it is identically zero or a coefficient overflows.

    ``known``, updated, has the canonical forms of parts of earlier genes.
    """
    try:
        return regressor(gene, known)[1]
    except ModelError:
        return None
