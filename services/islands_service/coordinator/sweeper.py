"""Sweeps: deletion of expired rows and unreferenced blobs, by every coordinator."""

from time import CLOCK_BOOTTIME, clock_gettime, monotonic, time

import structlog

from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Seconds between two sweeps.
SWEEP_INTERVAL = 600.0

#: Seconds for which a finished delivery of a webhook is kept.
DELIVERY_RETENTION = 7 * 86_400.0

#: Seconds after which a blob that no row references is deleted.
ORPHAN_AGE = 3600.0

#: Seconds by which the clock of the database may go forward between two sweeps, beyond the time that passes.
CLOCK_JUMP = 3600.0

#: Seconds for which nothing is deleted after a larger jump: time to repair a wrong clock.
CLOCK_PAUSE = 86_400.0


class Sweeper:
    """Deletes what has expired. A failed sweep is logged, and the next one does its work.

    Parameters
    ----------
    settings : ServiceSettings
    store : Store
    blobs : Blobs
    delay : float
        Seconds until the first sweep.
    """

    def __init__(self, settings: ServiceSettings, store: Store, blobs: Blobs, delay: float) -> None:
        self._settings, self._store, self._blobs = settings, store, blobs
        self._sweep_at = monotonic() + delay
        # Difference between the clock of the database and the uptime of this machine, and the uptime at which
        # it has jumped.
        self._offset: float | None = None
        self._jumped_at: float | None = None

    def sweep_if_due(self) -> None:
        """Sweep if the last sweep was long ago."""
        if monotonic() > self._sweep_at:
            self._sweep_at = monotonic() + SWEEP_INTERVAL
            try:
                if self._is_clock_credible():
                    self._sweep()
            except (StoreError, OSError) as error:
                log.warning("sweep failed", reason=str(error))

    def _is_clock_credible(self) -> bool:
        """Return False after a jump of the clock, by which all finished jobs may seem to have expired."""
        uptime = clock_gettime(CLOCK_BOOTTIME)
        offset = self._store.retention.read_clock() - uptime
        if self._offset is not None and offset - self._offset > CLOCK_JUMP:
            self._jumped_at = uptime if self._jumped_at is None else self._jumped_at
            if uptime - self._jumped_at < CLOCK_PAUSE:
                log.error("clock jumped: nothing is deleted", seconds=round(offset - self._offset))
                return False
        self._offset, self._jumped_at = offset, None
        return True

    def _sweep(self) -> None:
        self._store.database.reserve.fill()
        retention = self._store.retention
        if self._settings.retention:
            retention.delete_expired(self._settings.retention)
        expired = retention.expire_datasets(self._settings.dataset_retention)
        if self._settings.audit_retention:
            retention.delete_old_audit(self._settings.audit_retention)
        self._store.deliveries.sweep(DELIVERY_RETENTION)
        # Read the clock before the references, and those before the files: a blob that is referenced only
        # after the query is younger than the limit.
        before = time() - ORPHAN_AGE
        removed = self._blobs.sweep(retention.named_blobs(), before)
        log.info("swept", blobs=removed, datasets=expired)
