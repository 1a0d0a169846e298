"""Figures of a finished job: ``python -m islands_service.reports.figure_worker JOB``.

Drawing takes seconds and must not delay requests, so it has a process. Standard output is meant for the
owner of the job, standard error for the operator.
"""

import argparse
import io
import json
import resource
import sys
from collections.abc import Mapping
from errno import EAGAIN, EINVAL, ENODATA, ENOSPC
from typing import Any

import numpy as np

from islands.data.split import split_data
from islands.errors import IslandsError, SettingsError
from islands.evolution.presets import resolve_settings
from islands.evolution.search_result import RankedModel, SearchResult, SearchStatistics
from islands.figures.registry import FIGURES, SEARCH_FIGURES, search_figures
from islands.figures.style import save
from islands.io.checkpoints import history_from_document
from islands.io.models import model_from_json
from islands.simulation.predictors import free_run
from islands.validation.assessment import assess
from islands_service.domain.job import REPORT, Job
from islands_service.domain.job_spec import identification_of
from islands_service.intake.job_inputs import record_and_validation
from islands_service.reports.identification_report import identification_report
from islands_service.settings import ServiceSettings, service_settings
from islands_service.store import Store
from islands_service.store.blobs import BlobNotFoundError, Blobs
from islands_service.store.database import StorageFullError, StoreError

#: Samples of a simulation that are handed out as numbers: a screen shows no more.
POINTS = 4000

#: Bytes of address space for the libraries and the figures, beside what the records take, and seconds of all
#: cores together.
_MEMORY, _SECONDS = 8_000_000_000, 600


def main() -> int:
    """Draw what is asked for, all figures of a model or all of the search, and keep it."""
    command = "python -m islands_service.reports.figure_worker"
    parser = argparse.ArgumentParser(prog=command, description=__doc__)
    parser.add_argument("job")
    parser.add_argument("--owner", required=True)
    parser.add_argument("--rank", type=int, help="a model's; without it, the figures of the search")
    asked = parser.parse_args()
    settings = service_settings()
    _limit(settings)
    blobs = Blobs(settings.blobs)
    try:
        with Store(settings.url) as store:
            job = store.jobs.get(asked.owner, asked.job)
            found = read_search_result(job, store, blobs, asked.rank)
            made = (
                render_figures(job, found) if asked.rank is None else render_model_figures(found, asked.rank)
            )
            store.results.keep(asked.job, {name: blobs.write(data) for name, data in made.items()})
    except StorageFullError as error:
        return _failed(error, ENOSPC)
    except StoreError as error:
        return _failed(error, EAGAIN)
    except BlobNotFoundError as error:
        return _failed(error, ENODATA)
    except IslandsError as error:
        print(error)
        return EINVAL
    return 0


def _limit(settings: ServiceSettings) -> None:
    # A record and what it is validated on were each read within what an inspection may take.
    for kind, most in (
        (resource.RLIMIT_AS, 2 * settings.inspection_memory + _MEMORY),
        (resource.RLIMIT_CPU, _SECONDS),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(kind, (most, most))


def _failed(error: IslandsError, status: int) -> int:
    print(error, file=sys.stderr)
    return status


def read_search_result(job: Job, store: Store, blobs: Blobs, rank: int | None) -> SearchResult:
    """Put a finished job's findings together again, with the model of a rank or with all.

    Raises
    ------
    IslandsError
        The job, its data or the model is not there any more.
    """
    spec = identification_of(job.spec)
    datasets = {name: store.datasets.get(job.owner, name) for name in spec.datasets}
    record, validation = record_and_validation(spec, datasets, blobs)
    split = split_data(record, validation)
    settings = resolve_settings(spec.preset, spec.changes)
    document = store.results.document(job.id)
    stored = store.results.models(job.id, rank)
    if document is None or not stored:
        raise SettingsError(f"job {job.id} has no such model: wait until it has succeeded")
    models = [model_from_json(entry.file, f"model {entry.rank}") for entry in stored]
    assessed = tuple(
        RankedModel(model, assess(model, split, settings.shooting, settings.maximum_lag)) for model in models
    )
    search = _search(document["search"], store.results.history(job.id))
    return SearchResult(record, split, spec.seed, document["settings"], search, assessed)


def _search(document: Mapping[str, Any], history: list[list[Any]]) -> SearchStatistics:
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
    )


def render_figures(job: Job, found: SearchResult) -> dict[str, bytes]:
    """Draw the figures of a search and write its report, by the names of their artefacts."""
    made = {f"{name}.svg": _svg(SEARCH_FIGURES[name](found)) for name in search_figures(found)}
    best = {f"{name}.svg": _svg(draw(found.models[0], found.split)) for name, draw in FIGURES.items()}
    return {**made, REPORT: identification_report(job.name or job.id, found, {**best, **made})}


def render_model_figures(found: SearchResult, rank: int) -> dict[str, bytes]:
    """Draw a model's figures, and simulate it, by the names of their artefacts."""
    entry = found.models[0]
    made = {f"{rank}/{name}.svg": _svg(draw(entry, found.split)) for name, draw in FIGURES.items()}
    made[f"{rank}/free-run.json"] = _simulated(entry, found)
    return made


def _svg(figure: Any) -> bytes:
    stream = io.BytesIO()
    save(figure, stream)
    return stream.getvalue()


def _simulated(entry: RankedModel, found: SearchResult) -> bytes:
    """Return the validation data and the model's free run over it, thinned for a screen."""
    data = found.split.validation
    simulated = free_run(entry.model, data, entry.assessment.warm_up)
    every = max(1, -(-data.samples // POINTS))
    kept = slice(None, None, every)
    time = data.start + data.dt * np.arange(data.samples)
    document = {
        "outcome": str(simulated.outcome),
        "every": every,
        "time_s": time[kept].tolist(),
        "inputs": {name: data.u[kept, index].tolist() for index, name in enumerate(data.input_names)},
        "measured": data.y[kept].tolist(),
        "free_run": [value if np.isfinite(value) else None for value in simulated.y[kept].tolist()],
    }
    return json.dumps(document).encode()


if __name__ == "__main__":
    sys.exit(main())
