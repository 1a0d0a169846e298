"""Dashboard of a service that needs a key."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from support.played import advance, stored
from support.screen import Screen
from support.service_client import ServiceClient
from support.stores import taken


@pytest.fixture(scope="module")
def locked(hosted: Callable[..., Any]) -> Iterator[ServiceClient]:
    with hosted(require_keys=True) as service:
        yield service


@pytest.fixture
def key(locked: ServiceClient) -> str:
    """A key of a new owner, which the client of the test uses, too."""
    secret = make_key(locked, "read", "write")
    locked.client.headers["Authorization"] = f"Bearer {secret}"
    locked._dataset = ""
    return secret


def make_key(service: ServiceClient, *scopes: str, owner: str | None = None) -> str:
    with stored(service) as store:
        return store.keys.create("test", frozenset(scopes), owner)[1]


def enter(page: Any, secret: str) -> None:
    page.get_by_label("Key").fill(secret)
    page.keyboard.press("Enter")


@pytest.mark.ci
def test_the_key_form_rejects_wrong_keys_and_keeps_a_valid_one(
    screens: Callable[..., Screen], locked: ServiceClient, key: str, expect: Any
) -> None:
    job = locked.submit(500, name="mine")
    page = screens(locked.url).go(f"#/jobs/{job}")
    expect(page.get_by_role("heading", name="This service needs a key")).to_be_visible()
    expect(page.get_by_role("alert")).to_be_empty()
    expect(page.get_by_label("Key")).to_be_focused()
    enter(page, "islands_wrong")
    expect(page.get_by_role("alert")).to_contain_text("the key is unknown")
    enter(page, "kein Schlüssel")
    expect(page.get_by_role("alert")).to_contain_text("no spaces")
    enter(page, f" {key} ")
    expect(page.get_by_role("heading", name="mine")).to_be_visible()
    page.reload()
    expect(page.get_by_role("heading", name="mine")).to_be_visible()
    kept = page.evaluate(
        "[{ ...sessionStorage }['islands.key'], JSON.stringify(localStorage), document.cookie]"
    )
    assert kept == [key, "{}", ""]
    page.get_by_role("button", name="Forget the key").click()
    expect(page.get_by_label("Key")).to_be_visible()
    assert page.evaluate("sessionStorage.getItem('islands.key')") is None


@pytest.mark.ci
def test_the_key_is_in_no_url(screens: Callable[..., Screen], locked: ServiceClient, key: str) -> None:
    screen = screens(locked.url)
    send_request: list[str] = []
    screen.page.on("request", lambda request: send_request.append(request.url))
    page = screen.go()
    enter(page, key)
    page.get_by_role("heading", name="No jobs yet").wait_for()
    assert len(send_request) > 5
    assert not [url for url in [*send_request, page.url] if key in url]


@pytest.mark.ci
def test_event_streams_are_opened_with_the_key(
    screens: Callable[..., Screen], locked: ServiceClient, key: str, expect: Any
) -> None:
    job = locked.submit(500)
    page = screens(locked.url).go(f"#/jobs/{job}")
    enter(page, key)
    with stored(locked) as store:
        lease = taken(store, job)
        for last in (5, 6, 7):
            advance(store, lease, last, last)
            expect(page.locator(".status .progress-text")).to_have_text(f"{last} / 500")


@pytest.mark.nightly
def test_an_action_without_its_scope_shows_a_problem(
    screens: Callable[..., Screen], locked: ServiceClient, key: str, expect: Any
) -> None:
    job = locked.submit(500)
    with stored(locked) as store:
        owner = store.keys.find(key).owner
    page = screens(locked.url).go(f"#/jobs/{job}")
    enter(page, make_key(locked, "read", owner=owner))
    page.get_by_role("button", name="Cancel").click()
    banner = page.locator(".banner")
    expect(banner).to_contain_text("the key has the scopes read, but this request needs write")
    banner.get_by_role("button", name="Dismiss").click()
    expect(banner).to_have_count(0)
    assert locked.job(job)["state"] == "queued"
