"""Order of the owners in the queue: start-time fair queueing.

Every claim of an owner has a start tag, the virtual time of the owner: the larger one of the start tag of its
last claim plus ``STRIDE / weight``, and of the virtual time of the queue, which is the largest start tag of
all claims. The owner with the smallest tag is served. Owners with queued jobs therefore get claims in
proportion to their weights, and an owner that has been idle gets no credit for that time.

Between two claims of owner ``i`` that always has a job that can be claimed, owner ``j`` gets at most
``1 + w_j / w_i`` claims, whatever the number of its jobs: its tags in that time are ``STRIDE / w_j`` apart
and in an interval of the length ``STRIDE / w_i``. No owner waits for ever. Two owners with equal weights get
claims in turn.

Tags are integers, so that sums of many strides are exact.

References
----------
.. [1] P. Goyal, H. M. Vin, H. Cheng, "Start-time fair queueing: a scheduling algorithm for integrated
   services packet switching networks", IEEE/ACM Transactions on Networking 5 (1997), theorem 1.
.. [2] C. A. Waldspurger, W. E. Weihl, "Stride scheduling", MIT/LCS/TM-528 (1995).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import (
    CTE,
    BigInteger,
    Connection,
    CursorResult,
    Float,
    Row,
    Select,
    String,
    bindparam,
    func,
    literal,
    or_,
    select,
    tuple_,
)

from islands_service.domain.job import MONITORING, WAITING_PHASE, Job, JobState, find_seconds_left
from islands_service.domain.owner import DEFAULT_WEIGHT
from islands_service.store import dialect
from islands_service.store.dialect import now
from islands_service.store.job_rows import read_document
from islands_service.store.submission_checks import select_quota
from islands_service.store.tables import jobs, owners

#: Virtual time between two claims of an owner with weight 1.
STRIDE = 10**9

#: Least tag of the next claim of an owner; 0 before its first claim.
_NEXT = func.coalesce(owners.c.virtual_time + literal(STRIDE) // owners.c.weight, 0)

#: Virtual time of the queue.
_NOW = func.coalesce(select(func.max(owners.c.virtual_time)).scalar_subquery(), 0)
_WEIGHT = func.coalesce(owners.c.weight, DEFAULT_WEIGHT)
_QUEUED = jobs.c.state == JobState.QUEUED

#: Running jobs of an owner, and its weight.
_SHARE = select(
    func.count().label("running"),
    func.coalesce(
        select(owners.c.weight).where(owners.c.name == bindparam("owner")).scalar_subquery(), DEFAULT_WEIGHT
    ).label("weight"),
).where(jobs.c.owner == bindparam("owner"), jobs.c.state == JobState.RUNNING)

# Built once, since building a statement takes as long as executing it.
_USAGE = (
    select(
        func.count().label("running"),
        func.coalesce(func.sum(jobs.c.islands), 0).label("islands"),
        select_quota(owners.c.max_running, "most_running").label("most_running"),
        select_quota(owners.c.max_islands, "most_islands").label("most_islands"),
    )
    .select_from(jobs)
    .where(jobs.c.owner == bindparam("owner"), jobs.c.state == JobState.RUNNING)
)
_ISLANDS = select(jobs.c.islands).where(jobs.c.id == bindparam("id"))
_RUNNING = select(jobs.c.progress, jobs.c.updated, now().label("now")).where(jobs.c.state == JobState.RUNNING)


def _select_waiting() -> CTE:
    """Return a query for the owners with queued jobs, and null.

    It searches the index once for each owner, whatever the number of its jobs: DISTINCT would read them all.
    """
    least = select(func.min(jobs.c.owner).label("owner")).where(_QUEUED)
    waiting = least.cte("waiting", recursive=True)
    following = least.where(jobs.c.owner > waiting.c.owner).correlate(waiting).scalar_subquery()
    return waiting.union_all(select(following).where(waiting.c.owner.is_not(None)))


def _select_ranked() -> Select[Any]:
    waiting = _select_waiting()
    running = (
        select(jobs.c.owner, func.count().label("count"), func.sum(jobs.c.islands).label("islands"))
        .where(jobs.c.state == JobState.RUNNING)
        .group_by(jobs.c.owner)
        .subquery()
    )
    most = func.coalesce(owners.c.max_running, bindparam("most_running", type_=BigInteger))
    most_islands = func.coalesce(owners.c.max_islands, bindparam("most_islands", type_=BigInteger))
    islands = func.coalesce(running.c.islands, 0)
    return (
        select(
            waiting.c.owner.label("name"),
            _NEXT.label("next"),
            _NOW.label("now"),
            _WEIGHT.label("weight"),
            func.coalesce(running.c.count, 0).label("running"),
            islands.label("islands"),
            most_islands.label("most_islands"),
        )
        .outerjoin(owners, owners.c.name == waiting.c.owner)
        .outerjoin(running, running.c.owner == waiting.c.owner)
        .where(waiting.c.owner.is_not(None))
        .where(or_(most.is_(None), func.coalesce(running.c.count, 0) < most))
        # Every job has an island.
        .where(or_(most_islands.is_(None), islands < most_islands))
        .order_by("next", "name")
    )


def _select_backlogs() -> Select[Any]:
    waiting = (
        select(jobs.c.owner, func.count().label("count")).where(_QUEUED).group_by(jobs.c.owner).subquery()
    )
    return select(
        waiting.c.owner.label("name"), _NEXT.label("next"), _NOW.label("now"), _WEIGHT, waiting.c.count
    ).outerjoin(owners, owners.c.name == waiting.c.owner)


def _select_own_earlier() -> Select[Any]:
    """Return a query for the number of queued jobs of an owner that precede one of its jobs."""
    mine = select(func.count()).where(_QUEUED, jobs.c.owner == bindparam("owner"))
    # Two counts, each of a range of the index.
    higher = mine.where(jobs.c.priority > bindparam("priority"))
    place = tuple_(bindparam("created", type_=Float), bindparam("id", type_=String))
    older = mine.where(jobs.c.priority == bindparam("priority"), tuple_(jobs.c.created, jobs.c.id) < place)
    return select(higher.scalar_subquery() + older.scalar_subquery())


# Built once, since building them takes as long as executing them.
_RANKED, _BACKLOGS, _OWN_EARLIER = _select_ranked(), _select_backlogs(), _select_own_earlier()


def rank_owners(
    connection: Connection, most_running: int | None, most_islands: int | None
) -> CursorResult[Any]:
    """Return the owners with queued jobs in the order of their turns, for `has_room` and `charge_owner`.

    Parameters
    ----------
    most_running, most_islands : int, optional
        Quotas of running jobs, and of their islands, of an owner that has no other ones. Owners that have
        used up one of them are omitted.
    """
    return connection.execute(_RANKED, {"most_running": most_running, "most_islands": most_islands})


def has_room(turn: Row[Any], islands: int) -> bool:
    """Return whether an owner may run a job with these islands, given a row with its quota.

    A job with more islands than the quota, which was lowered after the submission, runs alone.
    """
    return turn.most_islands is None or turn.islands == 0 or turn.islands + islands <= turn.most_islands


def list_deprived(
    connection: Connection, owner: str, most_running: int | None, most_islands: int | None
) -> list[Row[Any]]:
    """Return the owners with queued jobs that have fewer running jobs for their weight than an owner.

    The quotas are those of `rank_owners`, and so are the order and the rows.
    """
    own = connection.execute(_SHARE, {"owner": owner}).one()
    with rank_owners(connection, most_running, most_islands) as turns:
        return [turn for turn in turns if turn.running * own.weight < own.running * turn.weight]


def charge_owner(connection: Connection, turn: Row[Any]) -> None:
    """Count a claim of an owner, given its row of `rank_owners`."""
    dialect.upsert(connection, owners, {"name": turn.name}, {"virtual_time": max(turn.next, turn.now)})


def estimate_positions(connection: Connection, found: Iterable[Job]) -> dict[str, int]:
    """Return the positions of the queued ones of some jobs in the order of claims; 1 is claimed next.

    They hold if every queued job can be claimed, and no other one arrives.
    """
    backlogs = {row.name: _Backlog(*row) for row in connection.execute(_BACKLOGS)}
    return {
        job.id: 1 + _count_earlier(connection, job, backlogs)
        for job in found
        if job.state == JobState.QUEUED and job.owner in backlogs
    }


@dataclass(frozen=True, slots=True)
class _Backlog:
    """Queued jobs of an owner, and the tags of their claims."""

    name: str
    next: int
    now: int
    weight: int
    count: int

    def tag(self, number: int) -> tuple[int, str]:
        """Return the tag of a claim, counted from 0. Tags of all owners order the claims."""
        if number == 0:
            return self.next, self.name
        return max(self.next, self.now) + number * (STRIDE // self.weight), self.name

    def count_before(self, tag: tuple[int, str]) -> int:
        """Return the number of claims of this owner before the claim of another owner with a tag."""
        if self.tag(0) > tag:
            return 0
        latest = tag[0] - (self.name > tag[1])
        return min(self.count, 1 + max(0, (latest - max(self.next, self.now)) // (STRIDE // self.weight)))


def _count_earlier(connection: Connection, job: Job, backlogs: dict[str, _Backlog]) -> int:
    values = {"owner": job.owner, "priority": job.priority, "created": job.created, "id": job.id}
    own: int = connection.execute(_OWN_EARLIER, values).scalar_one()
    tag = backlogs[job.owner].tag(own)
    return own + sum(each.count_before(tag) for each in backlogs.values() if each.name != job.owner)


@dataclass(frozen=True, slots=True)
class QueuePlace:
    """Place of a queued job.

    Attributes
    ----------
    position : int
        See `estimate_positions`.
    note : str
        The quota that the job waits for; empty if it waits for none.
    seconds_to_start : float or None
        Estimated seconds until it starts; None if they are unknown. See `_estimate_start`.
    """

    position: int
    note: str = ""
    seconds_to_start: float | None = None


def find_places(
    connection: Connection, found: Iterable[Job], most_running: int | None, most_islands: int | None
) -> dict[str, QueuePlace]:
    """Return the places of the queued ones of some jobs.

    Parameters
    ----------
    most_running, most_islands : int, optional
        Quotas of running jobs, and of their islands, of an owner for which none were set; unlimited by
        default.
    """
    listed = list(found)
    positions = estimate_positions(connection, listed)
    quotas = {"most_running": most_running, "most_islands": most_islands}
    queued = [job for job in listed if job.id in positions]
    usage = {
        owner: connection.execute(_USAGE, {"owner": owner, **quotas}).one()
        for owner in {job.owner for job in queued}
    }
    left = _list_times_left(connection) if queued else []
    places = {}
    for job in queued:
        position, note = positions[job.id], _explain_wait(connection, job, usage[job.owner])
        places[job.id] = QueuePlace(position, note, _estimate_start(job, position, note, left))
    return places


def _list_times_left(connection: Connection) -> list[float]:
    """Return the known times left of running jobs in seconds, the shortest first."""
    found = (
        find_seconds_left(read_document(row.progress) or {}, row.updated, row.now)
        for row in connection.execute(_RUNNING)
    )
    return sorted(seconds for seconds in found if seconds is not None)


def _estimate_start(job: Job, position: int, note: str, left: Sequence[float]) -> float | None:
    """Return the seconds until a job starts: those after which as many running jobs have ended.

    A job earlier in the queue whose run is shorter lets it start before. None is returned if jobs have to
    start and end before it, whose duration is unknown, or if it does not wait for the end of a running job:
    for a quota, for the time of its next attempt, or for earlier records of its monitor.
    """
    waits_otherwise = note or job.kind == MONITORING or (job.progress or {}).get("phase") == WAITING_PHASE
    return None if waits_otherwise or position > len(left) else left[position - 1]


def _explain_wait(connection: Connection, job: Job, usage: Row[Any]) -> str:
    if usage.most_running is not None and usage.running >= usage.most_running:
        return f"waits for your quota of running jobs: {usage.running} of {usage.most_running} are running"
    if usage.most_islands is None:
        return ""
    own = connection.execute(_ISLANDS, {"id": job.id}).scalar_one()
    if has_room(usage, own):
        return ""
    return (
        f"waits for your quota of running islands: {usage.islands} of {usage.most_islands} are running, and "
        f"this job has {own}"
    )
