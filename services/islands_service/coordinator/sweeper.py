"""Sweeps: deletion of expired rows and unreferenced blobs, by every coordinator."""

from time import monotonic, time

import structlog

from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs

log = structlog.get_logger()

#: Seconds between two sweeps.
SWEEP_INTERVAL = 600.0

#: Seconds for which a finished delivery of a webhook is kept.
DELIVERY_RETENTION = 7 * 86_400.0

#: Seconds after which a blob that no row references is deleted.
ORPHAN_AGE = 3600.0


class Sweeper:
    """Deletes what has expired.

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

    def sweep_if_due(self) -> None:
        """Sweep if the last sweep was long ago.

        Raises
        ------
        StoreError, OSError
        """
        if monotonic() > self._sweep_at:
            self._sweep_at = monotonic() + SWEEP_INTERVAL
            self._sweep()

    def _sweep(self) -> None:
        retention = self._store.retention
        if self._settings.retention:
            retention.delete_expired(self._settings.retention)
        if self._settings.audit_retention:
            retention.delete_old_audit(self._settings.audit_retention)
        self._store.deliveries.delete_old(DELIVERY_RETENTION)
        # Read the clock before the references, and those before the files: a blob that is referenced only
        # after the query is younger than the limit.
        before = time() - ORPHAN_AGE
        removed = self._blobs.sweep(retention.named_blobs(), before)
        log.info("swept", blobs=removed)
