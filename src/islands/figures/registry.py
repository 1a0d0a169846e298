"""Tables of the figures of a model and of the figures of a search."""

from collections.abc import Callable, Mapping
from math import isfinite
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

ModelFigure = Callable[[RankedModel, Split], Figure]


def _free_run(entry: RankedModel, split: Split) -> Figure:
    """Draw the measured output, the free run with its prediction band, and the residual over time."""
    band = None
    if entry.bands is not None:
        band = entry.bands.predict(entry.model, split.validation, warm_up=entry.assessment.warm_up)
    return draw_free_run(split.validation, _simulate(entry, split), band=band)


def _loop(entry: RankedModel, split: Split) -> Figure:
    """Draw the measured output and the free run against every input."""
    return draw_loop(split.validation, _simulate(entry, split))


def _simulate(entry: RankedModel, split: Split) -> NDArray[np.float64]:
    """Return the free run on the validation data, with the warm-up of the metrics."""
    return free_run(entry.model, split.validation, entry.assessment.warm_up).y


def _hold(entry: RankedModel, split: Split) -> Figure:
    """Draw the output while the input is held at five levels."""
    return draw_holds(entry.model, split.estimation)


def _residuals(entry: RankedModel, _split: Split) -> Figure:
    """Draw the correlation functions of the residual with their 95 % band, and its verdict."""
    structure = entry.assessment.residual_structure
    shares = ((structure.one_step_share, "one step ahead"), (structure.free_run_share, "in free run"))
    parts = ", ".join(f"{100 * share:.0f} % {mode}" for share, mode in shares if isfinite(share))
    title = f"residual {structure.verdict}" + (f": predictable part {parts}" if parts else "")
    return draw_residual_correlations(entry.assessment.residual_tests, title)


FIGURES: Mapping[str, ModelFigure] = MappingProxyType(
    {"free-run": _free_run, "loop": _loop, "hold": _hold, "residuals": _residuals}
)

#: The figure that needs a loop.
_LOOP = "loop"


def model_figures(result: SearchResult) -> tuple[str, ...]:
    """Return the names of the figures of a model that can be drawn for a result."""
    return tuple(name for name in FIGURES if name != _LOOP or result.has_loop)


def _record(result: SearchResult) -> Figure:
    """Draw every input and the output of the estimation data."""
    return draw_record(result.split.estimation)


#: Figures of a search; those of its convergence need a history.
SEARCH_FIGURES: Mapping[str, Callable[[SearchResult], Figure]] = MappingProxyType(
    {"record": _record, "front": draw_front, "convergence": draw_convergence, "islands": draw_islands}
)

#: Smallest number of islands in the history that a figure needs.
_MIN_ISLANDS = {"convergence": 1, "islands": 2}


def search_figures(result: SearchResult) -> tuple[str, ...]:
    """Return the names of the search figures that can be drawn for a result."""
    history = result.search.history
    islands = len(history[-1].islands) if history else 0
    return tuple(name for name in SEARCH_FIGURES if islands >= _MIN_ISLANDS.get(name, 0))
