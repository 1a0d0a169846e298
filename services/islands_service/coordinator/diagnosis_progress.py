"""Progress of a diagnosis: its phase, the completed fraction and the time left."""

from collections.abc import Callable, Iterable, Iterator
from time import monotonic
from typing import TypeVar

import structlog

from islands.discrepancy.interfaces.parallel import ParallelMap
from islands_service.domain.job import Lease, ProgressReport
from islands_service.store import Store
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Seconds between two reports within a step.
REPORT_EVERY = 0.5

#: Fraction of a diagnosis that the fits of a step take.
STEP = 0.2

#: Fraction from which the time left is estimated.
MIN_FRACTION = 0.05

A = TypeVar("A")
R = TypeVar("R")


class DiagnosisProgress:
    """Progress callback that stores the progress of a diagnosis.

    Parameters
    ----------
    lease : Lease
    store : Store
    check : callable
        Raises the reason if the job must end early; called at the start of each step.
    """

    def __init__(self, lease: Lease, store: Store, check: Callable[[], None]) -> None:
        self._lease, self._store, self._check = lease, store, check
        self._started_at = self._reported_at = monotonic()
        self._phase, self._begin = "", 0.0

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        """Store the start of a step."""
        self._check()
        self._phase = message
        self._begin = self._begin if fraction is None else fraction
        self._report(self._begin)

    def count(self, parallel_map: ParallelMap) -> ParallelMap:
        """Return a map that reports how many of its calls have ended, as a part of the current step."""

        def counted_map(function: Callable[[A], R], arguments: Iterable[A], /) -> Iterator[R]:
            listed = list(arguments)
            for ended, result in enumerate(parallel_map(function, listed), start=1):
                yield result
                if monotonic() - self._reported_at > REPORT_EVERY:
                    self._report(min(1.0, self._begin + STEP * ended / len(listed)))

        return counted_map

    def _report(self, fraction: float) -> None:
        self._reported_at = monotonic()
        spent = self._reported_at - self._started_at
        left = spent * (1.0 - fraction) / fraction if fraction >= MIN_FRACTION else None
        progress = {"phase": self._phase, "fraction": fraction, "seconds_left": left}
        try:
            self._store.leases.report(self._lease, ProgressReport(progress))
        except StoreError as error:
            # Continue the analysis. The next report has the progress.
            log.warning("report failed", job=self._lease.job.id, reason=str(error))
