"""Write the dump of a revision: a small database with rows in every table, written by the current code.

Run this file once after adding a revision, and commit the dump. An existing dump must not be rewritten,
because databases of that revision exist.
"""

import sqlite3
import sys
import tempfile
from contextlib import closing
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[4]))

from islands_service.domain.job import Requester
from islands_service.store import Store
from islands_service.store.job_rows.monitor_records import update_monitor
from islands_service.store.migrations.upgrade import HEAD
from support.monitor_updates import make_update
from support.stores import ALICE, BLOB, BOB, EXPIRED, FAILED, FOUND, brought_on, claimed, submitted

FOLDER = Path(__file__).parent


def fill(store: Store) -> None:
    """Add rows to every table, and a job in every state."""
    store.keys.create("revoked", frozenset({"read", "write"}), ALICE, seconds=3600.0)
    store.keys.revoke(store.keys.all()[0].id)
    preview = {"columns": [{"name": "u", "unit": "µm"}]}
    store.datasets.add(ALICE, "Bühne.csv", ".csv", BLOB, 12, preview, source="https://example.org/a.csv")
    store.webhooks.create(ALICE, "https://hooks.example.org/a", ("job.succeeded",), 1)
    monitor = store.monitors.create(ALICE, "press", {"input": "u"}, 0, 1)
    job = submitted(store, monitor=monitor.id)
    store.jobs.cancel(ALICE, job.id)
    store.database.write(lambda connection: update_monitor(connection, job.id, make_update(monitor, [4])))
    for outcome, owner in ((FOUND, ALICE), (FAILED, BOB)):
        submitted(store, owner, name="it's done; really", idempotency_key="k")
        lease = claimed(store)
        store.leases.report(lease, brought_on(3))
        store.leases.finish(lease, outcome)
        store.results.keep(lease.job.id, {"pareto.svg": BLOB})
    store.jobs.cancel(ALICE, submitted(store).id)
    deleted = submitted(store, idempotency_key="deleted")
    store.jobs.cancel(ALICE, deleted.id, Requester("192.0.2.1", "0123456789abcdef"))
    store.jobs.delete(ALICE, deleted.id, Requester("command line"))
    submitted(store, priority=-7, tags=("rig 2",))
    store.leases.report(claimed(store, EXPIRED), brought_on(5))
    submitted(store, BOB, priority=100, spec={"value": 0.1 + 0.2})


def main() -> None:
    target = FOLDER / f"{HEAD}.sql"
    if target.exists():
        raise SystemExit(f"{target} exists already: databases of this revision may exist, too")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "islands.db"
        with Store(f"sqlite:///{path}") as store:
            fill(store)
        with closing(sqlite3.connect(path)) as connection:
            target.write_text("\n".join(connection.iterdump()) + "\n")


if __name__ == "__main__":
    main()
