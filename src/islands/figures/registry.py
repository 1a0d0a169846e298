"""The table of figures that a result shows: each draws an assessed model on the data that it belongs to."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from islands.data.split import Split
from islands.evolution.search_result import RankedModel, SearchResult
from islands.figures.convergence import draw_convergence, draw_front, draw_islands
from islands.figures.free_run import draw_free_run
from islands.figures.hold import draw_holds
from islands.figures.hysteresis_loop import draw_loop
from islands.figures.record import draw_record
from islands.figures.residuals import draw_residual_correlations
from islands.simulation.predictors import free_run

FigureOf = Callable[[RankedModel, Split], Figure]


def _free_run(entry: RankedModel, split: Split) -> Figure:
    """Draw the measured output, the free run and the residual over time."""
    return draw_free_run(split.validation, _simulated(entry, split))


def _loop(entry: RankedModel, split: Split) -> Figure:
    """Draw the measured output and the free run against every input."""
    return draw_loop(split.validation, _simulated(entry, split))


def _simulated(entry: RankedModel, split: Split) -> NDArray[np.float64]:
    """Return the free run that the model's metrics are of."""
    return free_run(entry.model, split.validation, entry.assessment.warm_up).y


def _hold(entry: RankedModel, split: Split) -> Figure:
    """Draw the output while the input is held at five levels."""
    return draw_holds(entry.model, split.estimation)


def _residuals(entry: RankedModel, _split: Split) -> Figure:
    """Draw the correlation functions of the residual with their 95 % band."""
    return draw_residual_correlations(entry.assessment.residual_tests)


FIGURES: Mapping[str, FigureOf] = MappingProxyType(
    {"free-run": _free_run, "loop": _loop, "hold": _hold, "residuals": _residuals}
)


def _record(found: SearchResult) -> Figure:
    """Draw every input and the output of the estimation data."""
    return draw_record(found.split.estimation)


#: Figures of a whole search; those of its course need a history.
SEARCH_FIGURES: Mapping[str, Callable[[SearchResult], Figure]] = MappingProxyType(
    {"record": _record, "front": draw_front, "convergence": draw_convergence, "islands": draw_islands}
)

#: Islands whose course a search needs for a figure of it.
_ISLANDS = {"convergence": 1, "islands": 2}


def search_figures(found: SearchResult) -> tuple[str, ...]:
    """Return the names of the search figures that these findings have."""
    history = found.search.history
    islands = len(history[-1].islands) if history else 0
    return tuple(name for name in SEARCH_FIGURES if islands >= _ISLANDS.get(name, 0))
