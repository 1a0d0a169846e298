"""How ``islands jobs`` shows what a service answers: as JSON, as lines, as tables, as a folder of files."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import typer
from rich.table import Table

from islands_api.cli.console import output, progress
from islands_api.client import Client
from islands_api.schemas import JobView, ModelPage, ModelView
from islands_service.domain.job import DISCREPANCY, TERMINAL

#: Islands of a running job that are shown one by one.
_SHOWN = 16

#: A job in a list.
_LINE = "{:32}  {:9}  {:>13}  {:>10}  {:19}  {}"


def show_job(job: JobView, as_json: bool) -> None:
    """Show a job as it stands."""
    if as_json:
        print_json(job.model_dump(mode="json"))
        return
    output.print(f"job {job.id}: {job.state}", markup=False)
    told = job.progress or {}
    if "generation" in told:
        best = _number(told["best_error"])
        output.print(
            f"generation {told['generation']}/{told['generations']}, best error {best}", markup=False
        )
    if job.kind == DISCREPANCY:
        show_words(job)
    elif job.summary is not None:
        output.print(job.summary["equation"], markup=False)
    if job.problem is not None:
        output.print(job.problem["detail"], markup=False)


def show_words(job: JobView) -> None:
    """Show what a discrepancy job found, in words, or where it is."""
    if job.summary is not None:
        output.print(job.summary["words"], markup=False)
    elif job.progress is not None and job.state not in TERMINAL:
        output.print(job.progress["phase"], markup=False)


def show_jobs(jobs: Sequence[JobView], as_json: bool) -> None:
    """Show a list of jobs."""
    if as_json:
        print_json({"items": [job.model_dump(mode="json") for job in jobs]})
        return
    # Lines, not a table: that would cut ids off where there is little room, or nobody who reads.
    output.print(_LINE.format("job", "state", "generation", "best error", "created", "name"), markup=False)
    for job in jobs:
        told = job.progress or {}
        generation = f"{told.get('generation', '-')}/{told.get('generations', '-')}"
        best, created = _number(told.get("best_error")), f"{job.created:%Y-%m-%d %H:%M:%S}"
        line = _LINE.format(job.id, job.state, generation, best, created, f"{job.name}{_verdict(job)}")
        output.print(line, markup=False)


def _verdict(job: JobView) -> str:
    """Say in short what a discrepancy job found."""
    if job.kind != DISCREPANCY or job.summary is None:
        return ""
    return f" ({': '.join([job.summary['verdict'], *filter(None, [', '.join(job.summary['effects'])])])})"


def show_models(models: Sequence[ModelView]) -> None:
    """Show the models of a job: errors and physics of each, and their equations."""
    table = Table("rank", "terms", "MAPE est. %", "MAPE val. %", "hold drift %", "Property 1")
    for model in models:
        errors_of = [model.metrics[part]["free_run"]["mape"] for part in ("estimation", "validation")]
        table.add_row(
            str(model.rank),
            str(model.size),
            *map(_number, errors_of),
            _number(model.physics["hold_drift_percent"]),
            "yes" if model.physics["property_1"] else "no",
        )
    output.print(table)
    for model in models:
        output.print(f"{model.rank:2d}  {model.equation}", markup=False)


@contextmanager
def job_progress_bar() -> Iterator[Callable[[JobView], None]]:
    """Show how far a job is, in a moving bar."""
    with progress("job") as show_bar:

        def tell(job: JobView) -> None:
            told = job.progress or {}
            last = max(1, told.get("generations", 1))
            done = told.get("generation", 0)
            best = _number(told.get("best_error"))
            text = f"{job.state}, generation {done}/{told.get('generations', '?')}, best error {best}"
            if job.kind == DISCREPANCY:
                text = f"{job.state}, {told.get('phase', 'waiting')}"
            islands = [
                f"  island {index:3d}  RMSE {_number(error)}"
                for index, error in enumerate(told.get("islands", ())[:_SHOWN])
            ]
            show_bar(text, done / last if job.state not in TERMINAL else 1.0, islands)

        yield tell


def download(client: Client, job: str, document: dict[str, Any], folder: Path) -> None:
    """Write a result, its models and its figures into a folder; nothing of an earlier result stays there."""
    models = models_of(document)
    for name, kind in (("models", "[0-9][0-9]*.json"), ("figures", "*.svg")):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for old in (folder / name).glob(kind):
            old.unlink()
    for model in models:
        (folder / "models" / f"{model.rank:02d}.json").write_text(
            client.export(job, model.rank, "json"), encoding="utf-8"
        )
    with progress("figures") as tell:
        names = client.figures(job)
        for done, (name, rank) in enumerate(names):
            tell(name, done / len(names))
            (folder / "figures" / f"{name}.svg").write_bytes(client.figure(job, name, rank))
    _write_document(document, folder / "result.json")


def download_diagnosis(client: Client, job: str, document: dict[str, Any], folder: Path) -> None:
    """Write what a discrepancy job found into a folder, as ``islands diagnose`` does."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("extended.json", "discrepancy.json"):
        (folder / name).unlink(missing_ok=True)
    (folder / "report.html").write_bytes(client.report(job))
    if document["extended_model"] is not None:
        (folder / "extended.json").write_bytes(client.extended(job))
    _write_document(document, folder / "discrepancy.json")


def models_of(document: dict[str, Any]) -> tuple[ModelView, ...]:
    """Return the models of a result."""
    return ModelPage(items=document["models"]).items


@dataclass(frozen=True, slots=True)
class DownloadFolder:
    """How a result is kept and shown: its document's file, what the folder holds, and how it gets there."""

    file: str
    holds: str
    download: Callable[[Client, str, dict[str, Any], Path], None]
    show: Callable[[Client, str, dict[str, Any]], None]


#: By what a result holds.
RESULTS: Mapping[str, DownloadFolder] = MappingProxyType(
    {
        "models": DownloadFolder(
            "result.json",
            "result.json, models/, figures/",
            download,
            lambda _client, _job, document: show_models(models_of(document)),
        ),
        "verdict": DownloadFolder(
            "discrepancy.json",
            "discrepancy.json, report.html, extended.json where something was named",
            download_diagnosis,
            lambda client, job, _: show_words(client.job(job)),
        ),
    }
)


def _write_document(document: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def print_json(document: Any) -> None:
    """Print a document for programs."""
    typer.echo(json.dumps(document, indent=2))


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
