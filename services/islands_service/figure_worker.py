"""Figures of a finished job: ``python -m islands_service.figure_worker JOB``.

Rendering takes seconds and must not delay requests, so it runs in a separate process. Messages on standard
output are for the owner of the job, those on standard error for the operator.
"""

import argparse
import io
import json
import resource
import sys
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from errno import EAGAIN, EINVAL, EIO, ENODATA, ENOSPC, EROFS
from functools import partial
from typing import Any

from matplotlib.figure import Figure

from islands.errors import IslandsError, SettingsError
from islands.evolution.search_result import SearchResult, SearchStatistics
from islands.export import FILE_EXPORTS
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.model_analysis import split_point
from islands.persistence.checkpoints import history_from_document
from islands.persistence.ensembles import bands_from_document, ensemble_from_document
from islands.persistence.models import any_model_from_json, model_from_json, read_validated_model
from islands.persistence.saved_documents import read_criterion, read_shooting_interval
from islands.progress import Failure, attempt
from islands.records.coupled import AnyRecord, CoupledRecord, split_coupled
from islands.records.dataset import Dataset
from islands.records.split import average_split, match_split, split_data
from islands.report.documents.result_folder import result_document
from islands.report.figures.drawn_numbers import tabulate_lines
from islands.report.figures.linear_system import LINEAR_FIGURES
from islands.report.figures.names import name_free_runs
from islands.report.figures.registry import FIGURES, SEARCH_FIGURES, model_figures, search_figures
from islands.report.figures.style import save, write_text_figure
from islands.report.pages.comparison import ComparedModel, comparison_report
from islands.report.pages.identification import identification_report
from islands.report.pages.origin import Origin
from islands.validation.assessment import assess, with_refit
from islands_service.domain.fitted_models import read_fitted
from islands_service.domain.free_runs import write_free_runs
from islands_service.domain.job import FMU, REPORT, Job, name_free_run_artefacts
from islands_service.domain.job_spec import Identification, parse_identification
from islands_service.intake.job_inputs import read_record_and_validation
from islands_service.settings import ServiceSettings, service_settings
from islands_service.store import Store
from islands_service.store.blobs import BlobNotFoundError, Blobs, DataFolderUnavailableError
from islands_service.store.buckets import ObjectStoreError
from islands_service.store.cached_blobs import open_blobs
from islands_service.store.database import StorageFullError, StoreError
from islands_service.store.results import StoredModel

#: Bytes of address space for the libraries and the figures, in addition to the records.
_MEMORY = 8_000_000_000

#: Seconds of CPU time, all cores together.
_CPU_SECONDS = 600


def main() -> int:
    """Render and store all figures of a model or of the search."""
    command = "python -m islands_service.figure_worker"
    parser = argparse.ArgumentParser(prog=command, description=__doc__)
    parser.add_argument("job")
    parser.add_argument("--owner", required=True)
    parser.add_argument("--rank", type=int, help="rank of a model; without it, the figures of the search")
    parser.add_argument("--numbers", action="store_true", help="only the free run of the model as numbers")
    parser.add_argument("--fmu", action="store_true", help="only the model as FMU, which has to be compiled")
    parser.add_argument(
        "--linear",
        type=json.loads,
        metavar="JSON",
        help="write the figures of the linear system of the model to the standard output, as JSON by name; "
        "the value has the levels of its operating point by column, or none of them",
    )
    parser.add_argument(
        "--compare",
        nargs="+",
        metavar="JOB:RANK",
        help="write the report of a comparison of the model with these to the standard output",
    )
    arguments = parser.parse_args()
    settings = service_settings()
    _limit(settings)
    blobs = open_blobs(settings)
    try:
        with Store(settings.url) as store:
            if arguments.compare:
                sys.stdout.buffer.write(compare_models(arguments, store, blobs))
                return 0
            if arguments.linear is not None:
                job = store.jobs.get(arguments.owner, arguments.job)
                drawn = draw_linear_system(job, store, arguments.rank, arguments.linear)
                print(json.dumps({name: content.decode() for name, content in drawn.items()}))
                return 0
            made = _make(arguments, store, blobs)
            store.results.keep(arguments.job, {name: blobs.write(data) for name, data in made.items()})
    except StorageFullError as error:
        return _report_failure(error, ENOSPC)
    except DataFolderUnavailableError as error:
        return _report_failure(error, EROFS)
    except ObjectStoreError as error:
        return _report_failure(error, EIO)
    except StoreError as error:
        return _report_failure(error, EAGAIN)
    except BlobNotFoundError as error:
        return _report_failure(error, ENODATA)
    except IslandsError as error:
        print(error)
        return EINVAL
    return 0


def _make(arguments: argparse.Namespace, store: Store, blobs: Blobs) -> dict[str, bytes]:
    """Return what the arguments ask for, by artefact name."""
    job, rank = store.jobs.get(arguments.owner, arguments.job), arguments.rank
    if arguments.fmu:
        return compile_fmu(job, store, rank)
    if len(parse_identification(job.spec).outputs) > 1:
        return render_outputs(job, store, blobs)
    found = read_search_result(job, store, blobs, rank)
    if rank is None:
        return render_figures(job, found)
    if arguments.numbers:
        return _write_assessed(found, rank)
    return render_model_figures(found, rank)


def compare_models(arguments: argparse.Namespace, store: Store, blobs: Blobs) -> bytes:
    """Return the report of a comparison of models of the jobs of an owner.

    Raises
    ------
    IslandsError
        A job, its data or its model no longer exists.
    """
    pairs = [(arguments.job, arguments.rank), *map(_parse_model, arguments.compare)]
    jobs = {job: store.jobs.get(arguments.owner, job) for job, _ in pairs}
    names = _name_jobs(jobs.values())
    models = [_read_compared(jobs[job], names[job], rank, store, blobs) for job, rank in pairs]
    created = max(job.created for job in jobs.values())
    return comparison_report(Origin.from_seconds(", ".join(names.values()), created, arguments.owner), models)


def _name_jobs(jobs: Collection[Job]) -> dict[str, str]:
    """Return the names of jobs, with the beginning of the id of those without a unique one."""
    counts = Counter(job.name for job in jobs)
    return {
        job.id: job.name if job.name and counts[job.name] == 1 else f"{job.name} {job.id[:8]}".lstrip()
        for job in jobs
    }


def _parse_model(text: str) -> tuple[str, int]:
    job, _, rank = text.partition(":")
    return job, int(rank)


def _read_compared(job: Job, job_name: str, rank: int, store: Store, blobs: Blobs) -> ComparedModel:
    """Read a model with its free run, which is made and kept if it is not stored yet."""
    spec, document, (stored,) = _read_result(job, store, rank)
    free_run = None
    if len(spec.outputs) == 1:
        (name,) = name_free_run_artefacts(rank)
        blob = store.results.artefact(job.id, name)
        if blob is None:
            found = read_search_result(job, store, blobs, rank)
            blob = blobs.write(_write_assessed(found, rank)[name])
            store.results.keep(job.id, {name: blob})
        free_run = json.loads(blobs.read(blob))
    return ComparedModel(f"{job_name}, model {rank}", document, stored.document, free_run, job.spec)


def _limit(settings: ServiceSettings) -> None:
    # The record and the validation record were each read within the memory limit of an inspection.
    for kind, most in (
        (resource.RLIMIT_AS, 2 * settings.inspection_memory + _MEMORY),
        (resource.RLIMIT_CPU, _CPU_SECONDS),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (most, most))


def _report_failure(error: IslandsError, status: int) -> int:
    print(error, file=sys.stderr)
    return status


def read_search_result(job: Job, store: Store, blobs: Blobs, rank: int | None) -> SearchResult:
    """Rebuild the search result of a finished job, with the model of a rank or with all models.

    Raises
    ------
    IslandsError
        The job, its data or the model no longer exists.
    """
    spec, document, stored = _read_result(job, store, rank)
    record, validation = _read_records(spec, job, store, blobs)
    assert isinstance(record, Dataset)
    assert not isinstance(validation, CoupledRecord)
    models = [model_from_json(entry.file, f"model {entry.rank}") for entry in stored]
    average, shooting = models[0].average, read_shooting_interval(document)
    split = match_split(models[0], average_split(split_data(record, validation), average))
    ensemble = ensemble_from_document(document["ensemble"], models[0])
    assessed = []
    for entry, model in zip(stored, models, strict=True):
        criterion = read_criterion(entry.document)
        constraints, refit = document["settings"]["constraints"], entry.document["refit"]
        validated = read_validated_model(entry.document, model)
        assessment = assess(validated, split, shooting, entry.document["warm_up"], constraints, criterion)
        if refit:
            discarded = refit["discarded"] or ""
            assessment = with_refit(assessment, model, refit["samples"], discarded, split, constraints)
        bands = bands_from_document(entry.document["bands"], ensemble)
        assessed.append(replace(assessment, bands=bands))
    search = _search(document, store.results.history(job.id))
    return SearchResult(
        record, split, spec.seed, document["settings"], search, tuple(assessed), ensemble, average
    )


def _read_result(
    job: Job, store: Store, rank: int | None
) -> tuple[Identification, dict[str, Any], list[StoredModel]]:
    """Return the specification, the result document and the models of a finished job."""
    document = store.results.document(job.id)
    stored = store.results.models(job.id, rank)
    if document is None or not stored:
        raise SettingsError(f"job {job.id} has no such model: wait until it has succeeded")
    return parse_identification(job.spec), document, stored


def _read_records(
    spec: Identification, job: Job, store: Store, blobs: Blobs
) -> tuple[AnyRecord, AnyRecord | float]:
    datasets = {name: store.datasets.get(job.owner, name, deleted=True) for name in spec.datasets}
    return read_record_and_validation(spec, datasets, blobs)


def _search(result: Mapping[str, Any], history: list[list[Any]]) -> SearchStatistics:
    document = result["search"]
    return SearchStatistics(
        document["evaluations"],
        document["outcomes"],
        document["full_set"],
        document["wall_s"],
        document["generations"],
        document["duplicates"],
        document["feasible_share"],
        history_from_document(history),
        {},
        document["ended_by"],
        not_computed={each["step"]: each["reason"] for each in result["not_computed"]},
    )


def render_figures(job: Job, found: SearchResult) -> dict[str, bytes]:
    """Render the figures and the report of a search; return them by artefact name."""
    made = _save_all({name: partial(SEARCH_FIGURES[name], found) for name in search_figures(found)})
    entry = found.recommended
    names = model_figures(found, entry.model)
    model = _save_all({name: partial(FIGURES[name], entry, found.split) for name in names})
    equation = entry.model.equation().mathml
    system = FittedModel.from_search(found.recommendation.rank, entry, found).linear_system
    report = identification_report(_origin(job), result_document(found), equation, {**model, **made}, system)
    return {**made, REPORT: report}


def _origin(job: Job) -> Origin:
    return Origin.from_seconds(job.name or job.id, job.created, job.owner, job.id)


def render_model_figures(found: SearchResult, rank: int) -> dict[str, bytes]:
    """Render the figures and the free run of a model; return them by artefact name."""
    entry = found.models[0]
    names = model_figures(found, entry.model)
    drawn = {f"{rank}/{name}": partial(FIGURES[name], entry, found.split) for name in names}
    return _save_all(drawn) | _write_assessed(found, rank)


def _write_assessed(found: SearchResult, rank: int) -> dict[str, bytes]:
    """Return the free run of the first model of a search result, by artefact name."""
    entry = found.models[0]
    return write_free_runs(entry.model, entry.bands, entry.warm_up, found.split.validation, rank)


def draw_linear_system(job: Job, store: Store, rank: int, levels: Mapping[str, float]) -> dict[str, bytes]:
    """Return all figures of the linear system of a model about an operating point, by name.

    Raises
    ------
    IslandsError
        The model no longer exists, or it has no linear system there.
    """
    _, document, (stored, *_) = _read_result(job, store, rank)
    fitted = read_fitted(job.id, stored.file, stored.document, document)
    system = fitted.linearise(*split_point(fitted.model, levels))
    return _save_all({name: partial(draw, system) for name, draw in LINEAR_FIGURES.items()})


def compile_fmu(job: Job, store: Store, rank: int) -> dict[str, bytes]:
    """Return a model as FMU of FMI 3.0, by artefact name.

    Raises
    ------
    IslandsError
        The model no longer exists, or this machine has no C compiler.
    """
    _, _, (stored, *_) = _read_result(job, store, rank)
    return {f"{rank}/{FMU}": FILE_EXPORTS["fmu"](any_model_from_json(stored.file, f"model {rank}"))}


def render_outputs(job: Job, store: Store, blobs: Blobs) -> dict[str, bytes]:
    """Render the free run of every output of the model of a job, and its report.

    Raises
    ------
    IslandsError
        The job, its data or the model no longer exists.
    """
    spec, document, (stored, *_) = _read_result(job, store, None)
    fitted = read_fitted(job.id, stored.file, stored.document, document)
    record, held_out = _read_records(spec, job, store, blobs)
    assert isinstance(record, CoupledRecord)
    data = split_coupled(record, held_out).validation
    drawn = {
        name: partial(fitted.plot, record=data, output=output)
        for name, output in zip(name_free_runs(len(spec.outputs)), fitted.output_names, strict=True)
    }
    made = _save_all(drawn)
    complete = {**document, "models": [stored.document]}
    equation, system = fitted.model.equation().mathml, fitted.linear_system
    report = identification_report(_origin(job), complete, equation, made, system)
    figures = {f"1/{name}": figure for name, figure in made.items()}
    runs = write_free_runs(fitted.model, fitted.prediction_bands, fitted.warm_up, data, 1)
    return {**runs, **figures, REPORT: report}


def _save_all(figures: Mapping[str, Callable[[], Figure]]) -> dict[str, bytes]:
    """Return every figure as SVG and as a table of its lines, by artefact name.

    A figure that fails states the reason, so that the others and the report remain.
    """
    made = dict[str, bytes]()
    for name, draw in figures.items():
        saved = attempt(partial(_save, draw))
        if isinstance(saved, Failure):
            text = f"Not computed: {saved.reason}."
            saved = write_text_figure(text), f"# {text}\n"
        made |= {f"{name}.svg": saved[0], f"{name}.csv": saved[1].encode()}
    return made


def _save(draw: Callable[[], Figure]) -> tuple[bytes, str]:
    stream, figure = io.BytesIO(), draw()
    save(figure, stream)
    return stream.getvalue(), tabulate_lines(figure)


if __name__ == "__main__":
    sys.exit(main())
