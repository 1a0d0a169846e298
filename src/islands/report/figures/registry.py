"""Tables of the figures of a model and of the figures of a search."""

from collections.abc import Callable, Mapping
from functools import partial
from math import isfinite
from types import MappingProxyType
from typing import cast

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from islands.errors import ModelError, SettingsError, lookup
from islands.evolution.search_result import SearchResult
from islands.models.latent import LatentModel
from islands.models.protocol import DynamicModel
from islands.records.dataset import Dataset
from islands.records.split import Split
from islands.report.figures.availability import list_model_figures
from islands.report.figures.convergence import draw_convergence, draw_front, draw_islands
from islands.report.figures.free_run import draw_free_run, draw_free_run_panel
from islands.report.figures.hysteresis import draw_holds, draw_loop, draw_loop_panel
from islands.report.figures.latent import draw_structure, draw_unit_curves
from islands.report.figures.lines import break_line, downsample
from islands.report.figures.names import FREE_RUN, LEAST_ISLANDS, LOOP
from islands.report.figures.residuals import draw_residual_correlations
from islands.report.figures.static_model import draw_static_curve
from islands.report.figures.style import FRAME, MEASURED, RESIDUAL, blank, finish, house_style, label
from islands.simulation.initial_outputs import simulate_freely
from islands.validation.assessment import Assessment, assess_residual
from islands.validation.predictable_residual import ResidualStructure
from islands.validation.prediction_bands import PredictionBands
from islands.validation.residual_tests import ResidualTests

ModelFigure = Callable[[Assessment, Split], Figure]


#: Draws a model on a record, with a number of samples before the first prediction and prediction bands.
RecordFigure = Callable[[DynamicModel, Dataset, int, PredictionBands | None], Figure]


def _free_run_on(model: DynamicModel, record: Dataset, warm_up: int, bands: PredictionBands | None) -> Figure:
    band = None if bands is None else bands.predict(model, record, warm_up=warm_up)
    return draw_free_run(record, simulate_freely(model, record, warm_up).y, band=band)


def _static_curve_on(
    model: DynamicModel, record: Dataset, warm_up: int, bands: PredictionBands | None
) -> Figure:
    return draw_static_curve(model, [record], warm_up, bands)


def _loop_on(model: DynamicModel, record: Dataset, warm_up: int, _bands: PredictionBands | None) -> Figure:
    return draw_loop(record, simulate_freely(model, record, warm_up).y)


def _hold_on(model: DynamicModel, record: Dataset, _warm_up: int, _bands: PredictionBands | None) -> Figure:
    return draw_holds(model, record)


def _structure_on(
    model: DynamicModel, _record: Dataset, _warm_up: int, _bands: PredictionBands | None
) -> Figure:
    return draw_structure(_require_latent(model))


def _curves_on(model: DynamicModel, record: Dataset, warm_up: int, bands: PredictionBands | None) -> Figure:
    ensemble = None if bands is None else bands.ensemble
    return draw_unit_curves(_require_latent(model), record, warm_up, ensemble)


def _require_latent(model: DynamicModel) -> LatentModel:
    if not isinstance(model, LatentModel):
        raise ModelError(f"the figures structure and curves are of latent models, not of {model.kind} ones")
    return model


def _residuals_on(
    model: DynamicModel, record: Dataset, warm_up: int, _bands: PredictionBands | None
) -> Figure:
    return _draw_residuals(*assess_residual(model, record, warm_up))


#: Figures of a model on any record, by the names of `FIGURES`.
RECORD_FIGURES: Mapping[str, RecordFigure] = MappingProxyType(
    {
        "free-run": _free_run_on,
        "static-curve": _static_curve_on,
        "structure": _structure_on,
        "curves": _curves_on,
        "loop": _loop_on,
        "hold": _hold_on,
        "residuals": _residuals_on,
    }
)

#: Figures that one axes can hold, without their secondary panels.
PANELS = MappingProxyType({"free-run": draw_free_run_panel, "loop": draw_loop_panel})


def draw_record_figure(
    kind: str,
    model: DynamicModel,
    record: Dataset,
    warm_up: int,
    bands: PredictionBands | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Draw a figure of a model on a record.

    Parameters
    ----------
    kind : str
        A key of `RECORD_FIGURES`.
    model : DynamicModel
    record : Dataset
        Record with the inputs and the sampling time of the model.
    warm_up : int
        Number of samples before the first prediction.
    bands : PredictionBands, optional
        Prediction bands of the model.
    ax : Axes, optional
        Axes to draw the first panel into, in their own style.

    Returns
    -------
    Figure
        A new figure, or that of the axes.

    Raises
    ------
    SettingsError
        There is no such figure, or it does not fit into one axes.
    """
    draw = lookup(RECORD_FIGURES, kind, "figure")
    if ax is None:
        return draw(model, record, warm_up, bands)
    if kind not in PANELS:
        raise SettingsError(
            f"the figure {kind} has several panels: leave ax out, or take {', '.join(PANELS)}"
        )
    PANELS[kind](ax, record, simulate_freely(model, record, warm_up).y)
    return cast("Figure", ax.get_figure(root=True))


def _draw_on_part(name: str, entry: Assessment, split: Split) -> Figure:
    """Draw a figure of a model with the parameters of its errors: runs on the validation data."""
    part = split.validation if name in (FREE_RUN, LOOP) else split.estimation
    return RECORD_FIGURES[name](entry.model, part, entry.warm_up, entry.bands)


def _static_curve(entry: Assessment, split: Split) -> Figure:
    """Draw the output of a static model over its inputs, with the samples of both parts of the data."""
    return draw_static_curve(
        entry.final_model, [split.estimation, split.validation], entry.warm_up, entry.bands
    )


def _curves(entry: Assessment, split: Split) -> Figure:
    """Draw the curves of the units of a latent model over the arguments of both parts of the data."""
    ensemble = None if entry.bands is None else entry.bands.ensemble
    model = _require_latent(entry.model)
    return draw_unit_curves(model, split.estimation, entry.warm_up, ensemble, split.validation)


def _hold(entry: Assessment, split: Split) -> Figure:
    """Draw the output while the input is held at five levels."""
    return draw_holds(entry.final_model, split.estimation)


def _residuals(entry: Assessment, _split: Split) -> Figure:
    """Draw the correlation functions of the residual with their 95 % band, and its predictable part."""
    if reason := entry.residual_structure.not_computed:
        raise ModelError(f"the residuals are not tested ({reason})")
    return _draw_residuals(entry.residual_tests, entry.residual_structure)


def _draw_residuals(tests: ResidualTests, structure: ResidualStructure) -> Figure:
    shares = ((structure.one_step_share, "one step ahead"), (structure.free_run_share, "in free run"))
    parts = ", ".join(f"{100 * share:.0f} % {mode}" for share, mode in shares if isfinite(share))
    title = f"predictable part of the residual: {parts}" if parts else ""
    return draw_residual_correlations(tests, title)


#: Figures of an assessed model; those that need more than a part of the data are functions of their own.
FIGURES: Mapping[str, ModelFigure] = MappingProxyType(
    {name: partial(_draw_on_part, name) for name in RECORD_FIGURES}
    | {"static-curve": _static_curve, "curves": _curves, "hold": _hold, "residuals": _residuals}
)


def model_figures(result: SearchResult, model: DynamicModel) -> tuple[str, ...]:
    """Return the names of the figures that can be drawn for a model of a result."""
    return list_model_figures(model, result.has_loop)


def _record(result: SearchResult) -> Figure:
    """Draw every input and the output of the estimation data."""
    return draw_record(result.split.estimation)


#: Figures of a search; those of its convergence need a history.
SEARCH_FIGURES: Mapping[str, Callable[[SearchResult], Figure]] = MappingProxyType(
    {"record": _record, "front": draw_front, "convergence": draw_convergence, "islands": draw_islands}
)


def search_figures(result: SearchResult) -> tuple[str, ...]:
    """Return the names of the search figures that can be drawn for a result."""
    history = result.search.history
    islands = len(history[-1].islands) if history else 0
    return tuple(name for name in SEARCH_FIGURES if islands >= LEAST_ISLANDS.get(name, 0))


@house_style()
def draw_record(record: Dataset, title: str = "") -> Figure:
    """Draw every input and, below them, the output; segments are separated by gaps and lines."""
    names = [*record.input_names, record.output_name]
    units = [*record.input_units, record.output_unit]
    figure = blank(1.0 + 1.3 * len(names), title)
    panels = figure.subplots(len(names), sharex=True, squeeze=False)[:, 0]
    for axes, name, unit, values in zip(panels, names, units, [*record.u.T, record.y], strict=True):
        colour = MEASURED if axes is panels[-1] else RESIDUAL
        line = downsample(break_line(record, record.time), break_line(record, values))
        axes.plot(*line, color=colour, linewidth=0.7)
        axes.set_ylabel(label(name, unit))
        for begin, _ in record.bounds[1:]:
            axes.axvline(record.time[begin], color=FRAME, linewidth=0.6)
    panels[-1].set_xlabel("time (s)")
    return finish(figure)
