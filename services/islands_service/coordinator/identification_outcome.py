"""Outcome of an identification job: what the store keeps of its result."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import structlog

from islands.evolution.search_result import AnySearchResult
from islands.persistence.ensembles import model_file
from islands.progress import explain_failure
from islands.report.documents.result_folder import result_document
from islands.report.text.statements import describe
from islands.validation.assessment import Assessment
from islands.validation.coupled_assessment import CoupledAssessment
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.free_runs import write_free_runs
from islands_service.domain.job import JobOutcome, JobState

log = structlog.get_logger()


def make_outcome(found: AnySearchResult, note: str = "", ended_by: str = "") -> JobOutcome:
    """Return the part of a search result that the store keeps.

    Parameters
    ----------
    found : SearchResult
    note : str
        For the owner, in the summary.
    ended_by : str
        What ended the search, if it is not known to the search.
    """
    if ended_by:
        found = replace(found, search=replace(found.search, ended_by=ended_by))
    document = result_document(found)
    words = describe(document)
    models = document.pop("models")
    recommended = document["recommended"]
    best = models[recommended["rank"] - 1]
    summary = {
        "models": len(models),
        "rank": recommended["rank"],
        "reasons": recommended["reasons"],
        "words": "\n".join([*words, *([f"Note: {note}."] if note else [])]),
        "equation": "; ".join(found.recommended.final_model.equation().line.splitlines()),
        "size": best["size"],
        "metrics": best["metrics"]["validation"]["free_run"],
        "property_1": best.get("physics", {}).get("property_1", False),
        "evaluations": document["search"]["evaluations"],
        "wall_s": document["search"]["wall_s"],
        "ended_by": document["search"]["ended_by"],
        **({"note": note} if note else {}),
    }
    entries: Sequence[Assessment | CoupledAssessment] = found.models
    files = [model_file(entry.final_model, entry.bands) for entry in entries]
    return JobOutcome(JobState.SUCCEEDED, document, tuple(zip(models, files, strict=True)), summary)


def keep_free_runs(outcome: JobOutcome, write: Callable[[], dict[str, bytes]], run: JobRun) -> JobOutcome:
    """Return an outcome with the free run that a client shows first, if the job and its steps are complete.

    Without it, for example because the disk is full, the first request for it makes it in another process.
    It comes after the result, which it must not take away.
    """
    if outcome.state != JobState.SUCCEEDED or run.refusal:
        return outcome
    try:
        return replace(outcome, artefacts={name: run.blobs.write(data) for name, data in write().items()})
    except Exception as error:
        log.warning("free run not stored", job=run.job.id, reason=explain_failure(error))
        return outcome


def write_recommended(found: AnySearchResult) -> dict[str, bytes]:
    """Return the free run of every output of the recommended model by artefact name."""
    best, rank = found.recommended, found.recommendation.rank
    return write_free_runs(best.model, best.bands, best.warm_up, found.split.validation, rank)
