"""Functions that run the jobs of each kind."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import DISCREPANCY, IDENTIFICATION, MONITORING, JobOutcome

#: Runs a job of one kind and returns its outcome.
JobRunner: TypeAlias = Callable[[JobRun], JobOutcome]


def _run_identification(run: JobRun) -> JobOutcome:
    # These imports take half a second: claim the job before them.
    from islands_service.coordinator.identification_job import run_identification_job  # noqa: PLC0415

    return run_identification_job(run)


def _run_diagnosis(run: JobRun) -> JobOutcome:
    from islands_service.coordinator.diagnosis.job import run_diagnosis_job  # noqa: PLC0415

    return run_diagnosis_job(run)


def _run_monitoring(run: JobRun) -> JobOutcome:
    from islands_service.coordinator.monitoring_job import run_monitoring_job  # noqa: PLC0415

    return run_monitoring_job(run)


#: Runner of each kind of job.
JOB_RUNNERS: Mapping[str, JobRunner] = MappingProxyType(
    {IDENTIFICATION: _run_identification, DISCREPANCY: _run_diagnosis, MONITORING: _run_monitoring}
)
