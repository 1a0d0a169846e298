"""The store: one database, and the groups of operations of owners, coordinators and the API."""

from islands_service.store.audit import AuditTrail
from islands_service.store.database import Database
from islands_service.store.datasets import Datasets
from islands_service.store.jobs import Jobs
from islands_service.store.keys import Keys
from islands_service.store.leases import Leases
from islands_service.store.migrations.upgrade import prepare
from islands_service.store.monitors import Monitors
from islands_service.store.owners import Owners
from islands_service.store.readiness import Readiness
from islands_service.store.results import Results
from islands_service.store.retention import Retention
from islands_service.store.webhooks import Deliveries, Webhooks


class Store:
    """Persistent state of the service except blobs.

    Guarantees on every database, tested by `tests/contracts/test_store.py`: a write that has returned is
    durable. A job belongs to one lease at a time, and a write under an older one changes nothing and raises
    `LeaseLostError`. A checkpoint, its progress and its event appear together or not at all. An idempotency
    key names one job. Events of a job are numbered without gaps, in the order in which they became visible.
    An owner cannot access data of another owner. A change and its entry in the audit trail appear together;
    so do the end of a job and the deliveries of its webhooks. The records of a monitor are claimed one after
    the other, in the order of their submission; the end of the job and the new state of the monitor appear
    together.

    Parameters
    ----------
    url : str
        ``sqlite:////path/islands.db`` or ``postgresql+psycopg://...``.

    Raises
    ------
    StoreUnavailableError
        The database does not answer.
    StoreError
        The database was written by a newer version of islands.
    """

    def __init__(self, url: str) -> None:
        self.database = Database(url)
        try:
            prepare(self.database)
        except BaseException:
            self.database.close()
            raise
        self.readiness = Readiness(self.database)
        self.jobs = Jobs(self.database)
        self.leases = Leases(self.database)
        self.results = Results(self.database)
        self.datasets = Datasets(self.database)
        self.monitors = Monitors(self.database)
        self.keys = Keys(self.database)
        self.owners = Owners(self.database)
        self.webhooks = Webhooks(self.database)
        self.deliveries = Deliveries(self.database)
        self.retention = Retention(self.database)
        self.audit = AuditTrail(self.database)

    def close(self) -> None:
        """Write the queued operations and close all connections."""
        self.database.close()

    def __enter__(self) -> "Store":
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()
