"""``islands demo``: identification of the paper's case 1, compared with the paper's Table 1."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from time import perf_counter

from rich.table import Table

import islands
from islands.cli import options
from islands.cli.console import output, print_message
from islands.cli.engines import start_engine
from islands.cli.output_folder import RESULT_FILES, check_folder, keep_models, print_failures
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.search_progress import SearchDisplay
from islands.cli.stop_requests import stop_requests
from islands.evolution.evaluation import Evaluator
from islands.evolution.paper_search import estimate_again, list_models, rank_models, run_island
from islands.evolution.presets import PRESETS, resolve_settings
from islands.facade.identify import identify_record
from islands.models.coupled_narx import AnyModel
from islands.models.protocol import DynamicModel
from islands.progress import Steps
from islands.records.dataset import Dataset
from islands.records.writer import write_record
from islands.report.figures.names import ALL_FIGURES
from islands.simulation.predictors import free_run
from islands.systems.catalogue import SYSTEMS, make_record
from islands.systems.published_models import PUBLISHED
from islands.validation.metrics import Metrics, metrics

#: Number of islands: one for each core of the smallest supported machine.
ISLANDS = 2

#: Preset of the search.
PRESET = "hysteresis"

#: System of the paper's case 1.
SYSTEM = "bouc-wen-piezo"

#: Variant of the system with the parameters of the authors.
VARIANT = "authors"

#: The paper's search, and the part of its generations that the demonstration runs.
PAPER_PRESET, PAPER_GENERATIONS = "paper-case1", 100

#: Name of the model that this search selects.
_PAPER_SEARCH = "paper's search"

#: Title of the table of all models.
_TITLE = "Free run, 100 s: the paper's models and search, and the models found"

#: Name of the last step.
_COMPARISON = "comparison with the paper"

#: Parts of the record that select the model. The other parts are test data.
SELECTING = ("estimation", "validation")


def demo(
    out: options.Out = Path("demo-out"),
) -> None:
    """Identify the record of the paper's case 1 and compare the models with those of the paper."""
    check_folder(out, force=True)
    records = {part: make_record(SYSTEM, VARIANT, part) for part in SYSTEMS[SYSTEM].parts}
    estimation, validation = (records[part] for part in SELECTING)
    out.mkdir(parents=True, exist_ok=True)
    for part in SELECTING:
        write_record(records[part], out / f"{part}.csv")
    with _timed("kernels"):
        compile_kernels()
    with ExitStack() as handlers:
        with (
            _timed("search"),
            progress("demo") as show,
            start_engine(None, None, ISLANDS, print_message) as engine,
        ):
            # As in `islands.cli.runs.identify`.
            stop = handlers.enter_context(stop_requests())
            settings = resolve_settings(PRESET, {"islands": ISLANDS})
            searching = SearchDisplay(show, PRESET, estimation.samples, settings)
            began = perf_counter()
            found = identify_record(
                estimation,
                validation,
                preset=PRESET,
                islands=ISLANDS,
                progress=searching,
                on_epoch=searching.show_epoch,
                on_models=keep_models(out, estimation.output_names, show),
                stop=stop,
                engine=engine,
            )
            result = found.with_wall_time(perf_counter() - began)
        # The figures take seconds: the equation is shown before.
        output.print(str(result), markup=False)
        with progress("demo") as show:
            show("figures", None)
            drawing = Steps(stop=stop)
            with _timed("figures"):
                result.save(out, drawing, ALL_FIGURES)
            compared = Steps(show, stop)
            with _timed("models of the paper"):
                models = compared.attempt(_COMPARISON, partial(_make_paper_models, records, compared)) or {}
        print_failures({**drawing.not_computed, **compared.not_computed})
        output.print(f"{out}/: {RESULT_FILES}", markup=False)
        stop.end(out, (*result.left_out, *drawing.left_out, _COMPARISON), "repeat the command")

    _print_comparison(result, models, records)


@contextmanager
def _timed(phase: str) -> Iterator[None]:
    """Print the wall time of a phase after it."""
    began = perf_counter()
    yield
    print_message(f"{phase}: {perf_counter() - began:.0f} s")


def _print_comparison(
    result: islands.Result, models: Mapping[str, DynamicModel], records: Mapping[str, Dataset]
) -> None:
    """Print the errors of the paper's models and of the models found, by record."""
    # All models start after the same warm-up.
    warm_up = result.best.warm_up
    table = Table("model", "terms", "MAPE est. %", "MAPE val. %", "R2 est.", "R2 val.", title=_TITLE)
    for number in ("12", "13"):
        entry = PUBLISHED[number]
        table.add_row(f"({number}), Table 1", str(entry.model.size), *_format_cells(*entry.mape, *entry.r2))
    for name, model in models.items():
        errors_by_part = [_compute_metrics(model, records[part], warm_up) for part in SELECTING]
        label = f"{name}, {_describe_origin(name)}"
        table.add_row(label, str(model.size), *_format_row(errors_by_part))
    for fitted in result.models:
        errors_by_part = [fitted.metrics[part]["free_run"] for part in SELECTING]
        table.add_row(f"found, rank {fitted.rank}", str(fitted.model.size), *_format_row(errors_by_part))
    output.print(table)

    table = Table("test record", "recommended", *models, title="Free run, MAPE %")
    for part, record in records.items():
        if part not in SELECTING:
            compared = [result.best.model, *models.values()]
            table.add_row(
                part, *(f"{_compute_metrics(model, record, warm_up).mape:.3f}" for model in compared)
            )
    output.print(table)
    output.print("The paper validates over about 10 s. All of its tables, in a checkout:")
    output.print("    islands reproduce all")


def _make_paper_models(records: Mapping[str, Dataset], steps: Steps) -> dict[str, DynamicModel]:
    """Return the published models, estimated again, and the model that the paper's search selects."""
    estimation, validation = (records[part] for part in SELECTING)
    models: dict[str, DynamicModel] = {
        f"({number})": estimate_again(PUBLISHED[number], estimation) for number in ("12", "13")
    }
    settings = resolve_settings(PAPER_PRESET, {"generations": PAPER_GENERATIONS})
    island = run_island(
        Evaluator(estimation, settings),
        0,
        lambda island, _: steps(_PAPER_SEARCH, island.generation / settings.generations),
    )
    if ranked := rank_models(list_models(island, estimation), validation):
        models[_PAPER_SEARCH] = ranked[0]
    return models


def _describe_origin(name: str) -> str:
    """Describe how a model of the paper was computed."""
    if name == _PAPER_SEARCH:
        return f"{PAPER_GENERATIONS} of {PRESETS[PAPER_PRESET].generations} generations"
    return "estimated again"


def _compute_metrics(model: AnyModel, record: Dataset, warm_up: int) -> Metrics:
    """Return the metrics of a free run."""
    return metrics(record.y, free_run(model, record, warm_up).y)


def _format_row(found: Sequence[Metrics]) -> list[str]:
    return _format_cells(*(error.mape for error in found), *(error.r2 for error in found))


def _format_cells(mape_estimation: float, mape_validation: float, *r2: float) -> list[str]:
    return [f"{mape_estimation:.4f}", f"{mape_validation:.4f}", *(f"{value:.5f}" for value in r2)]
