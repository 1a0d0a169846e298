"""Laws of the fair queue between owners, in any order of submissions and claims."""

import shutil
import time
from collections import Counter
from itertools import pairwise
from uuid import uuid4

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sqlalchemy import delete, insert

from islands_service.store import Store
from islands_service.store.tables import events, jobs, owners
from support.stores import CANCELLED, LONG, claimed

OWNERS = "abcd"

weights = st.dictionaries(st.sampled_from(OWNERS), st.integers(1, 400), min_size=2)

# An example takes a hundred statements.
few = settings(max_examples=12)


@pytest.fixture(scope="module")
def fair(prepared_sqlite, tmp_path_factory):
    path = shutil.copyfile(prepared_sqlite, tmp_path_factory.mktemp("fair") / "islands.db")
    with Store(f"sqlite:///{path}") as store:
        yield store


def start(store, weighted):
    """Empty the store, and set the weights of owners."""

    def operation(connection):
        for table in (events, jobs, owners):
            connection.execute(delete(table))
        for name, weight in weighted.items():
            connection.execute(insert(owners).values(name=name, weight=weight))

    store.database.write(operation)


def submit(store, *several, first=0, islands=None):
    """Queue jobs of some owners, an owner and optionally islands for each, in one transaction."""
    rows = [
        {
            "id": f"{first + number:032x}",
            "owner": owner,
            "kind": "identification",
            "name": "",
            "spec": "{}",
            "request_sha256": "",
            "priority": 0,
            "state": "queued",
            "created": float(first + number),
            "updated": 0.0,
            "islands": 1 if islands is None else islands[number],
        }
        for number, owner in enumerate(several)
    ]
    store.database.write(lambda connection: connection.execute(insert(jobs), rows))


def claims(store, count):
    """Claim jobs; return their owners."""
    return [claimed(store).job.owner for _ in range(count)]


@pytest.mark.ci
@few
@given(weights, st.integers(5, 25))
def test_claims_of_backlogged_owners_are_in_proportion_to_their_weights(fair, weighted, count):
    """Start-time fair queueing: theorem 1 of Goyal, Vin and Cheng, for jobs of equal cost."""
    start(fair, weighted)
    submit(fair, *(owner for owner in weighted for _ in range(count)))
    served = claims(fair, count)
    for begin in range(count):
        for end in range(begin, count + 1):
            got = Counter(served[begin:end])
            for one, other in pairwise(weighted):
                shares = got[one] / weighted[one], got[other] / weighted[other]
                bound = 1 / weighted[one] + 1 / weighted[other]
                assert abs(shares[0] - shares[1]) <= bound * (1 + 1e-6)


@pytest.mark.ci
@few
@given(weights, st.lists(st.sampled_from(OWNERS), max_size=20), st.data())
def test_no_owner_waits_longer_than_its_bound(fair, weighted, earlier, data):
    """Whatever the owners have received before, and however many jobs the others have."""
    start(fair, weighted)
    if earlier:
        submit(fair, *earlier)
        claims(fair, len(earlier))
    late = data.draw(st.sampled_from(sorted(weighted)))
    others = sorted(weighted.keys() - {late})
    bound = sum(1 + -(-weighted[other] // weighted[late]) for other in others)
    most = min(bound, 40)
    submit(fair, late, *(owner for owner in others for _ in range(most)), first=1000)
    served = claims(fair, min(most + 1, most * len(others) + 1))
    assert bound > most or late in served


def test_idle_owner_gets_no_credit(fair):
    start(fair, {})
    submit(fair, *"a" * 20, "b")
    claims(fair, 11)
    submit(fair, *"b" * 10, first=100)
    got = Counter(claims(fair, 8))
    assert max(got.values()) - min(got.values()) <= 1


def test_claims_alternate_after_a_weight_is_changed(fair):
    start(fair, {"a": 300, "b": 100})
    submit(fair, *"a" * 40, *"b" * 40)
    claims(fair, 12)
    fair.database.write(lambda connection: connection.execute(owners.update().values(weight=100)))
    claims(fair, 2)
    assert Counter(claims(fair, 20)) == {"a": 10, "b": 10}


@few
@given(weights, st.lists(st.sampled_from(OWNERS), min_size=1, max_size=20), st.integers(0, 19))
def test_positions_are_the_order_of_the_claims(fair, weighted, queued, before):
    start(fair, weighted)
    submit(fair, *queued)
    before = min(before, len(queued) - 1)
    claims(fair, before)
    waiting = [job for owner in OWNERS for job in fair.jobs.page(owner, "queued").jobs]
    positions = {job: place.position for job, place in fair.leases.queue_places(waiting).items()}
    order = [claimed(fair).job.id for _ in waiting]
    assert sorted(positions, key=positions.__getitem__) == order
    assert sorted(positions.values()) == list(range(1, len(waiting) + 1))


@pytest.mark.ci
@few
@given(
    st.lists(st.tuples(st.sampled_from("ab"), st.integers(1, 6)), min_size=1, max_size=12),
    st.lists(st.integers(0, 3) | st.none(), max_size=30),
)
def test_running_islands_keep_the_quota_and_every_job_is_claimed_in_order(fair, several, steps):
    """Whatever the order of claims (None) and ends: of one owner no job overtakes another."""
    start(fair, {})
    submit(fair, *(owner for owner, _ in several), islands=[islands for _, islands in several])
    waiting = {name: [job for job in enumerate(several) if job[1][0] == name] for name in "ab"}
    running = []

    def fits(owner):
        used = sum(islands for _, (name, islands) in running if name == owner)
        return used == 0 or used + waiting[owner][0][1][1] <= 4

    def claim():
        ready = {owner for owner, left in waiting.items() if left and fits(owner)}
        lease = fair.leases.claim(uuid4().hex, LONG, most_islands=4)
        assert (lease.job.owner in ready) if ready else (lease is None)
        if lease is not None:
            number, job = waiting[lease.job.owner].pop(0)
            assert lease.job.created == number
            running.append((lease, job))

    for step in steps:
        if step is None:
            claim()
        elif running:
            fair.leases.finish(running.pop(step % len(running))[0], CANCELLED)
    while any(waiting.values()):
        claim()
        fair.leases.finish(running.pop()[0], CANCELLED)


@pytest.mark.ci
def test_ten_jobs_are_not_delayed_by_ten_thousand_of_another_owner(fair):
    start(fair, {})
    submit(fair, *"a" * 10_000)
    submit(fair, *"b" * 10, first=10_000)
    claims(fair, 2)
    began = time.process_time()
    served = claims(fair, 18)
    assert served.count("b") == 9
    assert (time.process_time() - began) / len(served) < 5e-3
