"""Owners: weights in the queue, quotas, and use of the service."""

import json
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, func, select, union, update

from islands.errors import IslandsError
from islands_service.domain.job import ACTIVE, JobState, Requester
from islands_service.domain.owner import (
    DEFAULT_WEIGHT,
    QUOTA_NAMES,
    Owner,
    Quotas,
    check_owner_changes,
    merge_quotas,
)
from islands_service.store import dialect
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.tables import datasets, jobs, keys, owners


class OwnerNotFoundError(IslandsError):
    """No key, job or data set has this owner."""


class Owners(DatabaseOperations):
    """Owner operations of the store."""

    def quotas(self, owner: str, defaults: Quotas) -> Quotas:
        """Return the quotas of an owner; those that are not set have their defaults."""
        query = select(*(owners.c[name] for name in QUOTA_NAMES)).where(owners.c.name == owner)
        with self._database.read() as connection:
            row = connection.execute(query).one_or_none()
        return defaults if row is None else merge_quotas(defaults, row._asdict())

    def all(self) -> tuple[Owner, ...]:
        """Return the owners of all keys, jobs and data sets by name."""
        with self._database.read() as connection:
            return _read_owners(connection)

    def get(self, owner: str) -> Owner:
        """Return an owner.

        Raises
        ------
        OwnerNotFoundError
        """
        with self._database.read() as connection:
            return _read_owner(connection, owner)

    def change(self, owner: str, changes: Mapping[str, int | None], by: Requester | None = None) -> Owner:
        """Change the weight and quotas of an owner; return it.

        Parameters
        ----------
        changes : mapping
            New ``weight`` and quotas by name; None restores the default.

        Raises
        ------
        OwnerNotFoundError
        SettingsError
            A name is unknown, or a value out of range.
        """
        check_owner_changes(changes)

        def operation(connection: Connection) -> Owner:
            _read_owner(connection, owner)
            if changes:
                values: dict[str, Any] = dict(changes)
                if values.get("weight", 1) is None:
                    values["weight"] = DEFAULT_WEIGHT
                dialect.upsert(connection, owners, {"name": owner}, values)
                if "max_run_seconds" in values:
                    limit = {"max_run_seconds": values["max_run_seconds"]}
                    unfinished = jobs.c.owner == owner, jobs.c.state.in_(ACTIVE)
                    connection.execute(update(jobs).where(*unfinished).values(limit))
                record_change(connection, Action.CHANGE_OWNER, owner, owner, by, json.dumps(values))
            return _read_owner(connection, owner)

        return self._database.write(operation)


def _read_owner(connection: Connection, name: str) -> Owner:
    found = _read_owners(connection, name)
    if not found:
        raise OwnerNotFoundError(
            f"there is no owner {name!r}: list them with 'islands admin owners', or create a key of it"
        )
    return found[0]


def _read_owners(connection: Connection, name: str | None = None) -> tuple[Owner, ...]:
    """Return all owners by name, or only the one of a name."""

    def of(query: Any, column: Any) -> Any:
        return query if name is None else query.where(column == name)

    columns = (owners.c.name, keys.c.owner, jobs.c.owner, datasets.c.owner)
    names = connection.execute(union(*(of(select(column), column) for column in columns))).scalars()
    active = select(jobs.c.owner, jobs.c.state, func.count(), func.sum(jobs.c.islands))
    counted = active.where(jobs.c.state.in_(ACTIVE))
    counts: dict[tuple[str, str], tuple[int, int]] = {
        (owner, state): (count, islands)
        for owner, state, count, islands in connection.execute(
            of(counted, jobs.c.owner).group_by(jobs.c.owner, jobs.c.state)
        )
    }
    summed = of(select(datasets.c.owner, func.sum(datasets.c.bytes)), datasets.c.owner)
    stored = {owner: int(total) for owner, total in connection.execute(summed.group_by(datasets.c.owner))}
    rows = {row.name: row._asdict() for row in connection.execute(of(select(owners), owners.c.name))}
    own: Mapping[str, Mapping[str, Any]] = defaultdict(dict, rows)
    return tuple(
        Owner(
            each,
            own[each].get("weight", DEFAULT_WEIGHT),
            {quota: own[each].get(quota) for quota in QUOTA_NAMES},
            counts.get((each, JobState.QUEUED), (0, 0))[0],
            *counts.get((each, JobState.RUNNING), (0, 0)),
            stored.get(each, 0),
        )
        for each in sorted(names)
    )
