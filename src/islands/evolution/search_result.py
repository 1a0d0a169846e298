"""What a search found: assessed models, the best first, and what it took to find them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np

from islands.data.dataset import Dataset
from islands.data.split import Split
from islands.evolution.history import HistoryPoint
from islands.model.equations import equation
from islands.model.model import Model
from islands.validation.assessment import Assessment


@dataclass(frozen=True, slots=True, eq=False)
class RankedModel:
    """A model and what is known of it."""

    model: Model
    assessment: Assessment


@dataclass(frozen=True, slots=True)
class SearchStatistics:
    """What a search did.

    Attributes
    ----------
    evaluations : int
        Models estimated.
    outcomes : mapping
        Number of models by outcome: ``{"ok": 9, "singular": 1}``.
    full_set : mapping
        ``candidates`` of the full polynomial set for the lags and degree searched, equation (5), and the
        ``bytes`` of its regressor matrix, which was never made.
    wall_s : float or None
        Seconds it took, from whoever has a clock.
    generations, duplicates, feasible_share
        Of an evolution: generations done, individuals whose structure was that of a parent or a sibling, and
        the share of individuals that got parameters; None for other searches.
    history : tuple of HistoryPoint
        The course of an evolution, oldest first.
    caches : mapping
        Bytes that every cache of an evolution takes at its end, and its limit.
    ended_by : str or None
        The budget that an evolution used up, or ``stopped``.
    """

    evaluations: int
    outcomes: Mapping[str, int]
    full_set: Mapping[str, int]
    wall_s: float | None = None
    generations: int | None = None
    duplicates: int | None = None
    feasible_share: float | None = None
    history: tuple[HistoryPoint, ...] = ()
    caches: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    ended_by: str | None = None

    @property
    def evaluations_per_second(self) -> float | None:
        """None where nobody looked at a clock."""
        return self.evaluations / self.wall_s if self.wall_s else None


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """All that a result says.

    Attributes
    ----------
    record : Dataset
        As it was given.
    split : Split
        The data that estimated, and the data that validated.
    seed : int
    settings : mapping
        Everything that determines the result, besides the record and the seed.
    search : SearchStatistics
    models : tuple of RankedModel
        Best first, as `rank_models` orders them.
    """

    record: Dataset
    split: Split
    seed: int
    settings: Mapping[str, Any]
    search: SearchStatistics
    models: tuple[RankedModel, ...]


def rank_models(models: Sequence[RankedModel]) -> tuple[RankedModel, ...]:
    """Order models by their free-run error on the validation data, the least first.

    Those that diverged there come last, by their one-step-ahead error, and behind them those that diverged
    even one step ahead; ties go to the smaller model, then to the text. Validation selects the model, so its
    error is no test of it.
    """
    return tuple(sorted(models, key=_key))


def _key(entry: RankedModel) -> tuple[bool, float, int, str]:
    errors = entry.assessment.metrics["validation"]
    diverged = bool(np.isnan(errors["free_run"].rmse))
    rmse = errors["one_step_ahead" if diverged else "free_run"].rmse
    return diverged, inf if np.isnan(rmse) else rmse, entry.model.size, equation(entry.model, digits=17)
