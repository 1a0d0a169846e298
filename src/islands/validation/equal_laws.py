"""Structures with equal free runs, which state one law.

``y(k) = 0.9 y(k-1) + u(k-1)`` is also ``y(k) = 0.81 y(k-2) + u(k-1) + 0.9 u(k-2)``, and ``sign(y(k-1))`` is
also ``sign(y(k-1)^3)``. The difference of two free runs is compared with the residual, and with the effect of
the terms that only one of the structures has. Terms that describe the noise have effects as small as the
difference, so that two structures with other terms of this kind are two laws.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from islands.estimation.damped_least_squares import inner_products
from islands.estimation.shooting_residual import make_residual
from islands.models.coupled_narx import AnyModel
from islands.records.coupled import AnyRecord
from islands.records.dataset import Dataset
from islands.rounding import ROUNDING
from islands.simulation.initial_outputs import estimate_initial_outputs, simulate_freely

#: Two free runs are equal if the mean square of their difference is at most this fraction of that of the
#: residual, and of the effect of other terms: the limit below which the predictable part of a residual is
#: negligible.
_EQUAL_SHARE = 0.1


def find_laws(
    models: Sequence[AnyModel], record: AnyRecord, warm_up: int, preferred: AnyModel | None = None
) -> list[int | None]:
    """Find for every model the one whose terms state its law.

    That is the model with the nearest free run among the shorter ones, and among those of its size that come
    before it, if the two free runs are equal. The model that lacks no term of the other one is never the same
    law: it states a further effect.

    Parameters
    ----------
    models : sequence of DynamicModel or CoupledModel
        Models with parameters whose free runs do not diverge.
    record : Dataset or CoupledRecord
    warm_up : int
        Number of samples before the first prediction.
    preferred : DynamicModel or CoupledModel, optional
        The model that states the law of those of its size.

    Returns
    -------
    list of int or None
        Position of that model; None for a model that states its own law.
    """
    comparison = _Comparison(models, record, warm_up)
    names = None if preferred is None else preferred.parameter_names
    order = sorted(
        range(len(models)),
        key=lambda at: (models[at].size, models[at].parameter_names != names, at),
    )
    laws: list[int | None] = [None] * len(models)
    for place, at in enumerate(order):
        equal = [
            (distance, other)
            for other in order[:place]
            if laws[other] is None and (distance := comparison.measure(at, other)) <= _EQUAL_SHARE
        ]
        laws[at] = min(equal)[1] if equal else None
    return laws


class _Comparison:
    """Comparison of the free runs of models.

    Parameters
    ----------
    models, record, warm_up
        As for `find_laws`.
    """

    def __init__(self, models: Sequence[AnyModel], record: AnyRecord, warm_up: int) -> None:
        self._models, self._record, self._warm_up = models, record, warm_up
        records = [record] if isinstance(record, Dataset) else record.records
        self._ranges = np.array([each.output_range for each in records])
        # As the residuals of a model: several outputs are relative to their ranges.
        self._scales = (
            np.ones(1) if isinstance(record, Dataset) else np.where(self._ranges, self._ranges, 1.0)
        )
        self._runs = [_as_columns(simulate_freely(model, record, warm_up).y) for model in models]
        self._products: dict[int, NDArray[np.float64]] = {}

    def measure(self, at: int, other: int) -> float:
        """Return the mean square of the difference of two free runs, relative to its scale.

        That is the mean square of the residual of the other model, or that of the effect of the terms of the
        other model which this model lacks, if it is smaller.
        """
        difference = np.nanmean((self._runs[at] - self._runs[other]) ** 2, axis=0)
        residual = np.nanmean((_as_columns(self._record.y) - self._runs[other]) ** 2, axis=0)
        floor = (ROUNDING * self._ranges) ** 2 + np.finfo(float).tiny
        share = float(np.max(difference / (residual + floor)))
        if share > _EQUAL_SHARE:
            return share
        effect = self._measure_effect(other, set(self._models[at].parameter_names))
        change = float(np.mean((np.sqrt(difference) / self._scales) ** 2))
        return max(share, change / effect) if effect > 0.0 else np.inf

    def _measure_effect(self, at: int, kept: set[str]) -> float:
        """Return the mean square of the change of a free run without some terms, to first order.

        The other parameters change so that it is the least: a term that others can replace has no effect.
        """
        is_kept = np.array([name in kept for name in self._models[at].parameter_names])
        if at not in self._products:
            self._products[at] = self._multiply_changes(at)
        products = self._products[at]
        if is_kept.all() or not np.isfinite(products).all():
            return 0.0
        left = products[np.ix_(is_kept, is_kept)]
        right = products[np.ix_(is_kept, ~is_kept)].sum(axis=1)
        whole = float(products[np.ix_(~is_kept, ~is_kept)].sum())
        scale = np.sqrt(np.where(np.diag(left) > 0.0, np.diag(left), 1.0))
        step = np.linalg.lstsq(left / scale / scale[:, None], right / scale, rcond=None)[0] / scale
        return whole - float(step @ right)

    def _multiply_changes(self, at: int) -> NDArray[np.float64]:
        """Return the mean products of the changes of a free run without each of the terms."""
        model = self._models[at]
        theta = np.array(model.parameters)
        started = estimate_initial_outputs(model, self._record, self._warm_up)
        slopes = make_residual(model, started, None, self._warm_up).differentiate(theta, np.diag(theta))
        rows = slopes.shape[1]
        products: NDArray[np.float64] = inner_products(slopes, np.zeros(rows), 0, rows)[0] / rows
        return products


def _as_columns(y: NDArray[np.float64]) -> NDArray[np.float64]:
    return y.reshape(len(y), -1)
