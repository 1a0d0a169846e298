"""Labels of jobs over REST: name and tags at submission and later, filters and search of the list."""

import pytest

from support.service import kept, problem_of, queued, spec


@pytest.fixture
def order(service):
    return spec(kept(service.store), name="first")


def test_name_and_tags_are_changed_separately(service, order):
    path = service.submit(**order).headers["location"]
    renamed = service.client.patch(path, json={"name": "Bühne 3"})
    assert (renamed.status_code, renamed.json()["name"], renamed.json()["tags"]) == (200, "Bühne 3", [])
    tagged = service.client.patch(path, json={"tags": ["a", "b"]})
    assert (tagged.json()["name"], tagged.json()["tags"]) == ("Bühne 3", ["a", "b"])
    looked = service.client.get(path)
    assert looked.json() == tagged.json()
    assert looked.headers["etag"] == tagged.headers["etag"] == '"3"'
    assert service.client.patch(path, json={}).headers["etag"] == '"3"'


@pytest.mark.parametrize(
    "body",
    [
        {"name": "a\nb"},
        {"name": "x" * 201},
        {"name": 3},
        {"tags": ["a,b"]},
        {"tags": [""]},
        {"tags": [" a"]},
        {"tags": ["a "]},
        {"tags": ["a\tb"]},
        {"tags": ["x" * 41]},
        {"tags": [f"{number}" for number in range(21)]},
        {"tags": "a"},
        {"priority": 3},
        ["a"],
    ],
)
def test_unusable_labels_are_refused(service, body):
    path = f"/v1/jobs/{queued(service.store).id}"
    problem_of(service.client.patch(path, json=body), 422, "invalid-request")
    assert service.client.get(path).headers["etag"] == '"1"'


def test_a_search_with_many_words_is_refused(service):
    answer = service.client.get("/v1/jobs", params={"q": "a " * 11})
    assert "q has 11 words, and 10 is the most" in problem_of(answer, 422, "invalid-settings")
