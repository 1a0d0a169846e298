"""Views of ``islands jobs``: answers of a service as JSON, lines, tables or a folder of files."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any

import typer
from rich.table import Table

from islands.cli.console import output
from islands.cli.progress_display import format_duration, progress
from islands.models.coupled_narx import list_models
from islands.persistence.models import any_model_from_json
from islands.report.pages.origin import REPORT_FILE
from islands.report.text.layout import LEGEND, MARK, term_table, wrap
from islands.simulators.specification.table import EXTENDED_FILE
from islands_api.client import Client
from islands_api.schemas import JobView, ModelPage, ModelView
from islands_service.domain.job import (
    BY_OWNER,
    DISCREPANCY,
    IDENTIFICATION,
    NEXT_EXPERIMENT,
    RUN_TIME,
    TERMINAL,
    JobState,
)

#: Largest number of islands that have a line each.
_SHOWN_ISLANDS = 16

#: How a search ended that used up none of its budgets, by the entry of its summary.
ENDED: Mapping[object, str] = MappingProxyType(
    {RUN_TIME: "ended at its limit of run time", BY_OWNER: "was stopped by its owner"}
)

#: Lines of a job in a list.
_LINE, _SECOND_LINE = "{:32}  {:9}  {:>13}  {:>10}", "  {:16}  {}"


def show_job(job: JobView, as_json: bool, client: Client | None = None) -> None:
    """Show the current state of a job; with a client also its result, if it has one."""
    client = client if job.summary is not None else None
    if as_json:
        result = {} if client is None else {"result": client.result(job)}
        print_json({**job.model_dump(mode="json"), **result})
        return
    output.print(f"job {job.id}: {job.state}", markup=False)
    status = job.progress or {}
    if "generation" in status:
        best = _format_number(status["best_error"])
        output.print(
            f"generation {status['generation']}/{status['generations']}, best error {best}", markup=False
        )
    if job.state == JobState.QUEUED:
        output.print(_describe_phase(job), markup=False)
    if status.get("note") and job.state not in TERMINAL:
        output.print(status["note"], markup=False)
    for warning in status.get("warnings", ()):
        output.print("\n".join(wrap(f"Warning: {warning}.")), markup=False)
    show_result(client, job)
    if job.problem is not None:
        output.print(job.problem["detail"], markup=False)


def show_labels(job: JobView, as_json: bool) -> None:
    """Show the name and the tags of a job."""
    if as_json:
        print_json(job.model_dump(mode="json"))
        return
    tags = f", tags: {', '.join(job.tags)}" if job.tags else ", no tags"
    output.print(f"job {job.id}: {job.name or 'no name'}{tags}", markup=False)


def describe_kept_models(job: JobView) -> str:
    """Return what a search has kept that did not end by itself, and how to get it; empty for other jobs."""
    summary = job.summary or {}
    is_cancelled, ended_by = job.state == JobState.CANCELLED, summary.get("ended_by")
    if job.kind != IDENTIFICATION or not summary or not (is_cancelled or ended_by in ENDED):
        return ""
    count = summary["models"]
    models = f"{count} model{'s' if count > 1 else ''} found so far"
    get = f"'islands jobs show {job.id} --out FOLDER' writes {'them' if count > 1 else 'it'} to a folder"
    if is_cancelled:
        return (
            f"was cancelled and kept the {models}: {get}, 'islands jobs change {job.id} --resume' continues"
        )
    return f"{ENDED[ended_by]} and kept the {models}: {get}"


def show_result(client: Client | None, job: JobView) -> None:
    """Show the models of a search, or the summary of a job as text; the phase of one that runs."""
    if client is not None and job.kind == IDENTIFICATION:
        show_models(client, job, client.models(job))
        if kept := describe_kept_models(job):
            output.print("\n".join(wrap(f"The job {kept}.")), markup=False)
    elif job.summary is not None:
        for line in job.summary["words"].splitlines():
            output.print("\n".join(wrap(line, "    ")), markup=False)
    elif job.progress is not None and job.state == JobState.RUNNING and job.kind != IDENTIFICATION:
        output.print(job.progress["phase"], markup=False)


def download_result(client: Client, job: JobView, folder: Path) -> None:
    """Write the result of a job into a folder, and print the names of its files."""
    document = client.result(job)
    kind = next(kind for name, kind in RESULTS.items() if name in document)
    kind.download(client, job.id, document, folder)
    output.print(f"{folder}/: {kind.contents}", markup=False)


def show_jobs(jobs: Sequence[JobView], as_json: bool) -> None:
    """Show a list of jobs."""
    if as_json:
        print_json({"items": [job.model_dump(mode="json") for job in jobs]})
        return
    # Not a table: it would truncate the ids in a narrow terminal or a pipe.
    output.print(_LINE.format("job", "state", "generation", "best error"), markup=False)
    output.print(_SECOND_LINE.format("created (UTC)", "name"), markup=False)
    for job in jobs:
        status = job.progress or {}
        done = status.get("generation")
        generation = "-" if done is None else f"{done}/{status.get('generations', '-')}"
        best = _format_number(status.get("best_error"))
        output.print(_LINE.format(job.id, job.state, generation, best), markup=False)
        name = " ".join([f"{job.name}{_format_verdict(job)}", *(f"[{tag}]" for tag in job.tags)])
        output.print(_SECOND_LINE.format(f"{job.created:%Y-%m-%d %H:%M}", name), markup=False)


def _format_verdict(job: JobView) -> str:
    """Return the verdict of a discrepancy job and its effects; empty for other jobs."""
    if job.kind != DISCREPANCY or job.summary is None:
        return ""
    return f" ({': '.join([job.summary['verdict'], *filter(None, [', '.join(job.summary['effects'])])])})"


def show_models(client: Client, job: JobView, models: Sequence[ModelView]) -> None:
    """Show the models of a job: the recommended one, and a table of errors and physical properties."""
    for line in _describe_recommended(client, job, models):
        output.print(line, markup=False)
    # Only models of hysteresis have Property 1; the drift of others is no defect.
    hysteresis = any(model.physics.get("property_1") for model in models)
    claims = ("drift %", "Property 1") if hysteresis else ()
    table = Table("rank", "terms", "MAPE est. %", "MAPE val. %", *claims, "residuals")
    for model in models:
        mape = [model.metrics[part]["free_run"]["mape"] for part in ("estimation", "validation")]
        drift = _format_number(model.physics.get("hold_drift_percent"))
        table.add_row(
            f"{model.rank}{MARK if model.recommended else ''}",
            str(model.size),
            *map(_format_number, mape),
            *((drift, "yes" if model.physics["property_1"] else "no") if hysteresis else ()),
            model.residual_tests.get("verdict", "-"),
        )
    output.print(table)
    output.print(LEGEND, markup=False)


def _describe_recommended(client: Client, job: JobView, models: Sequence[ModelView]) -> Iterator[str]:
    """Yield the lines that ``islands fit`` prints about the recommended model."""
    if not models:
        return
    rank = next((model.rank for model in models if model.recommended), 1)
    model = any_model_from_json(client.export(job.id, rank, "json"), f"model {rank}")
    terms = [line for single in list_models(model) for line in term_table(single)]
    # The equation in one line is indented.
    words = str((job.summary or {}).get("words", "")).splitlines()
    equation = next((at for at, line in enumerate(words) if line.startswith(" ")), len(words))
    yield from (line for sentence in words[:equation] for line in wrap(sentence))
    yield from ["", *terms, ""]
    yield from (line for sentence in words[equation + 1 :] for line in wrap(sentence.strip()))


@contextmanager
def job_progress_bar() -> Iterator[Callable[[JobView], None]]:
    """Show the progress of a job in a bar; yield the function that updates it."""
    # The service estimates the time left: this command may begin in the middle of a job.
    with progress("job", inf) as show:

        def update(job: JobView) -> None:
            status = job.progress or {}
            last = max(1, status.get("generations", 1))
            done = status.get("generation", 0)
            best = _format_number(status.get("best_error"))
            text = f"{job.state}, generation {done}/{status.get('generations', '?')}, best error {best}"
            # The other phases of a search are the stages before and after its epochs.
            searching = job.state in TERMINAL or status.get("phase", "search") == "search"
            if job.kind != IDENTIFICATION or not searching:
                text = f"{job.state}, {_describe_phase(job)}"
            islands = [
                f"  island {index:3d}  RMSE {_format_number(error)}"
                for index, error in enumerate(status.get("islands", ())[:_SHOWN_ISLANDS])
            ]
            fraction = status.get("fraction", done / last)
            left = status.get("seconds_left")
            show(text, fraction if job.state not in TERMINAL else 1.0, islands, left)

        yield update


def _describe_phase(job: JobView) -> str:
    """Return the phase of a job, its position in the queue, or its last note."""
    status = job.progress or {}
    if job.state == JobState.QUEUED:
        place = status.get("position")
        if place is None:
            return "waiting"
        start = status.get("seconds_to_start")
        return f"number {place} in the queue" + (
            "" if start is None else f", starts in about {format_duration(start)}"
        )
    return str(status.get("note") or status.get("phase", "waiting"))


def download(client: Client, job: str, document: dict[str, Any], folder: Path) -> None:
    """Write a result, its models and its figures into a folder; delete those of an earlier result."""
    models = parse_models(document)
    (folder / REPORT_FILE).unlink(missing_ok=True)
    for name, kind in (("models", "[0-9][0-9]*.json"), ("figures", "*.svg")):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for old in (folder / name).glob(kind):
            old.unlink()
    for model in models:
        (folder / "models" / f"{model.rank:02d}.json").write_text(
            client.export(job, model.rank, "json"), encoding="utf-8"
        )
    with progress("figures") as show:
        names = client.figures(job)
        for done, (name, rank) in enumerate(names):
            show(name, done / len(names))
            (folder / "figures" / f"{name}.svg").write_bytes(client.figure(job, name, rank))
    _write_document(document, folder / "result.json")


def download_diagnosis(client: Client, job: str, document: dict[str, Any], folder: Path) -> None:
    """Write the result of a discrepancy job into a folder, as ``islands diagnose`` does."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (EXTENDED_FILE, NEXT_EXPERIMENT, "discrepancy.json"):
        (folder / name).unlink(missing_ok=True)
    (folder / REPORT_FILE).write_bytes(client.report(job))
    if document["extended_model"] is not None:
        (folder / EXTENDED_FILE).write_bytes(client.extended(job))
    if (document.get("next_experiment") or {}).get("input"):
        (folder / NEXT_EXPERIMENT).write_text(client.next_experiment(job), encoding="utf-8")
    _write_document(document, folder / "discrepancy.json")


def download_record(_client: Client, _job: str, document: dict[str, Any], folder: Path) -> None:
    """Write the result of a record of a monitor into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    _write_document(document, folder / "record.json")


def parse_models(document: dict[str, Any]) -> tuple[ModelView, ...]:
    """Return the models of a result document."""
    return ModelPage(items=document["models"]).items


@dataclass(frozen=True, slots=True)
class DownloadFolder:
    """Folder of a downloaded result.

    Attributes
    ----------
    file : str
        File of the result document.
    contents : str
        Files of the folder, for a message.
    download : callable
        Function that writes the folder.
    """

    file: str
    contents: str
    download: Callable[[Client, str, dict[str, Any], Path], None]


#: Kinds of results, by a key of the result document.
RESULTS: Mapping[str, DownloadFolder] = MappingProxyType(
    {
        "models": DownloadFolder(
            "result.json",
            "result.json, models/, figures/",
            download,
        ),
        "verdict": DownloadFolder(
            "discrepancy.json",
            "discrepancy.json, report.html, extended.json if an effect was named, next-experiment.csv if an "
            "input separates causes",
            download_diagnosis,
        ),
        "record": DownloadFolder(
            "record.json",
            "record.json",
            download_record,
        ),
    }
)


def _write_document(document: dict[str, Any], path: Path) -> None:
    path.write_text(json.dumps(document, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def print_json(document: Any) -> None:
    """Print a document as JSON."""
    typer.echo(json.dumps(document, indent=2))


def _format_number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
