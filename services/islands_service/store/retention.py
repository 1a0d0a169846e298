"""Deletion of expired jobs and data sets, and the blobs that are still referenced."""

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from sqlalchemy import Column, ColumnElement, Connection, Update, delete, select, union, update

from islands_service.domain.job import TERMINAL, Requester, find_datasets
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.job_rows import delete_unused_datasets
from islands_service.store.tables import artefacts, audit, datasets, jobs, owners, retired_keys

#: Rows that are deleted in one transaction. A job has some thousands of events and points.
JOBS_AT_ONCE, ENTRIES_AT_ONCE, DATASETS_AT_ONCE = 50, 10_000, 200


def _change_datasets(order: Update, owner: str, connection: Connection) -> int:
    """Execute an update of data sets; record those that it hides, and return their number."""
    changed = connection.execute(order.returning(datasets.c.id, datasets.c.deleted)).all()
    hidden = [row.id for row in changed if row.deleted is not None]
    for dataset in hidden:
        record_change(connection, Action.EXPIRE_DATASET, owner, dataset, Requester("retention"))
    return len(hidden)


class Retention(DatabaseOperations):
    """Retention operations of the store."""

    def delete_expired(self, seconds: float) -> int:
        """Delete the jobs that finished more than the given seconds ago; return their number.

        Idempotency keys of jobs that finished as long ago and were deleted before can be used again.
        """
        old = jobs.c.state.in_(TERMINAL) & (jobs.c.finished < now() - seconds)
        deleted = self._delete(jobs.c.id, old, JOBS_AT_ONCE)

        def operation(connection: Connection) -> None:
            connection.execute(delete(retired_keys).where(retired_keys.c.finished < now() - seconds))
            delete_unused_datasets(connection)

        self._database.write(operation, urgent=True)
        return deleted

    def expire_datasets(self, seconds: int) -> int:
        """Delete the data sets that no job has named for some time; return their number.

        The time begins when this method first finds that no job names a data set, so that a retention that is
        introduced or changed deletes nothing at once. It begins again with another upload of the same bytes.

        A data set is hidden first. Its row is deleted by a later call, unless a job that was being submitted
        names it: that job can read it.

        Parameters
        ----------
        seconds : int
            Retention of an owner for which none was set; 0 for ever.
        """
        with self._database.read() as connection:
            query = select(owners.c.name, owners.c.dataset_retention)
            own = {row.name: row.dataset_retention for row in connection.execute(query)}
            every = select(datasets.c.owner, datasets.c.id, datasets.c.idle_since, datasets.c.deleted)
            found = connection.execute(every).all()
        idle: dict[str, dict[str, float | None]] = defaultdict(dict)
        for row in found:
            times = idle[row.owner]
            if row.deleted is None:
                times[row.id] = row.idle_since
        expired = 0
        for owner, times in idle.items():
            default = own.get(owner)
            expired += self._expire_datasets_of(owner, times, seconds if default is None else default)
        return expired

    def _expire_datasets_of(self, owner: str, times: Mapping[str, float | None], seconds: int) -> int:
        """Expire data sets of an owner, given the times since which they are idle."""
        if seconds:
            with self._database.read() as connection:
                specs = connection.execute(select(jobs.c.spec).where(jobs.c.owner == owner)).scalars()
                named = {name for spec in specs for name in find_datasets(json.loads(spec))}
        else:
            named = set(times)
        restarted = [name for name, since in times.items() if name in named and since is not None]
        started = [name for name, since in times.items() if name not in named and since is None]
        waiting = [name for name, since in times.items() if name not in named and since is not None]
        of_owner = (datasets.c.owner == owner, datasets.c.deleted.is_(None))

        def change(names: Sequence[str], *conditions: ColumnElement[bool], **values: Any) -> int:
            changed = 0
            for first in range(0, len(names), DATASETS_AT_ONCE):
                some = datasets.c.id.in_(names[first : first + DATASETS_AT_ONCE])
                order = update(datasets).where(*of_owner, *conditions, some).values(values)
                changed += self._database.write(partial(_change_datasets, order, owner), urgent=True)
            return changed

        change(restarted, idle_since=None)
        change(started, idle_since=now())
        if seconds:
            self._database.write(partial(delete_unused_datasets, owner=owner), urgent=True)
        return change(waiting, datasets.c.idle_since < now() - seconds, deleted=now())

    def delete_old_audit(self, seconds: float) -> None:
        """Delete the audit entries that are older than the given seconds."""
        self._delete(audit.c.number, audit.c.at < now() - seconds, ENTRIES_AT_ONCE)

    def _delete(self, key: Column[Any], old: ColumnElement[bool], at_once: int) -> int:
        """Delete the old rows of a table in several transactions; return their number.

        A long transaction would delay the heartbeats of this process for longer than a lease.
        """
        # The condition is repeated: a job may be resumed after it was selected.
        some = delete(key.table).where(old, key.in_(select(key).where(old).limit(at_once))).returning(key)
        deleted = 0
        while found := len(
            self._database.write(lambda connection: connection.execute(some).all(), urgent=True)
        ):
            deleted += found
            if found < at_once:
                break
        return deleted

    def read_clock(self) -> float:
        """Return the clock of the database in seconds since 1970."""
        with self._database.read() as connection:
            return float(connection.execute(select(now())).scalar_one())

    def named_blobs(self) -> frozenset[str]:
        """Return all blobs that a row references."""
        with self._database.read() as connection:
            return self.named_blobs_of(connection)

    @staticmethod
    def named_blobs_of(connection: Connection) -> frozenset[str]:
        """Return all blobs that a row references, as a connection sees the rows."""
        query = union(
            select(datasets.c.blob),
            select(artefacts.c.blob),
            select(jobs.c.checkpoint).where(jobs.c.checkpoint.is_not(None)),
        )
        return frozenset(connection.execute(query).scalars())
