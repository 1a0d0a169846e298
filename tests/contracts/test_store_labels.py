"""Contract of the store with clients that name, tag, filter and search their jobs, on every database."""

import pytest

from islands_service.domain.job import JobNotFoundError, JobOutcome, JobState
from support.stores import ALICE, BLOB, BOB, claimed, job_in, kinds, submitted


def found(store, owner=ALICE, **filters):
    return {job.id for job in store.jobs.page(owner, **filters).jobs}


def ended(store, summary, **given):
    """Submit a job that ends with a summary; return its id."""
    job = submitted(store, **given)
    store.leases.finish(claimed(store), JobOutcome(JobState.SUCCEEDED, {}, summary=summary))
    return job.id


@pytest.mark.parametrize("state", JobState)
def test_a_job_is_labelled_in_every_state(store, state):
    job = job_in(store, state, name="before", tags=("a",))
    before = kinds(store, job.id)
    changed = store.jobs.label(ALICE, job.id, "Bühne 3", ("b", "c d", "b"))
    assert (changed.name, changed.tags) == ("Bühne 3", ("b", "c d"))
    assert (changed.state, changed.spec, changed.summary) == (state, job.spec, job.summary)
    assert store.jobs.get(ALICE, job.id) == changed
    assert kinds(store, job.id) == [*before, "labelled"]


def test_only_the_owner_labels_a_job(store):
    job = submitted(store)
    with pytest.raises(JobNotFoundError):
        store.jobs.label(BOB, job.id, "mine")


def test_a_tag_selects_the_jobs_that_have_exactly_it(store):
    one, both = submitted(store, tags=("rig",)).id, submitted(store, tags=("rig 2", "rig")).id
    submitted(store, tags=("Rig", "ri", "rig%"))
    submitted(store, name="rig")
    assert found(store, tag="rig") == {one, both}
    assert found(store, tag="rig 2") == {both}
    assert found(store, tag="r_g") == found(store, tag="2") == found(store, BOB, tag="rig") == set()


def test_words_are_found_in_labels_data_set_and_result(store):
    dataset, _ = store.datasets.add(ALICE, "Füllstand_1.csv", ".csv", BLOB, 1, {})
    summary = {"equation": "y(k) = 0.9 y(k-1) + TANH(u(k-1))", "words": "unread", "size": 2}
    job = ended(store, summary, name="Straße 100%", tags=("Rig 2",), spec={"dataset": dataset.id})
    assert store.jobs.get(ALICE, job).dataset_name == "Füllstand_1.csv"
    other = ended(store, {"simulation": "duffing", "verdict": "named", "effects": ["thermal-drift"]})
    for words in (["strasse"], ["100%"], ["rig", "2"], ["FU\u0308LLSTAND_1"], ["tanh("], ["stra", "tanh"]):
        assert found(store, words=words) == {job}
    assert found(store, words=["thermal", "duffing"]) == {other}
    for words in (["unread"], ["straße", "thermal"], ["fullstand"], ["rig%2"], ["100_"]):
        assert found(store, words=words) == set()


def test_jobs_with_a_model_are_listed_by_its_error(store):
    errors = [3.5, 0.25, float("inf"), 3.5, 12.0]
    jobs = [ended(store, {"equation": "y", "metrics": {"mape": error}}, tags=("a",)) for error in errors]
    ended(store, {"verdict": "nothing"})
    submitted(store)
    seen, after = [], None
    while True:
        page = store.jobs.page(ALICE, after=after, limit=1, by_error=True)
        seen += [job.id for job in page.jobs]
        if (after := page.after) is None:
            break
    assert seen == [jobs[1], *sorted([jobs[0], jobs[3]]), jobs[4]]
    filtered = store.jobs.page(ALICE, tag="a", words=["y"], by_error=True)
    assert [job.id for job in filtered.jobs] == seen
