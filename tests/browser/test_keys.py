"""The page before a service that asks for a key."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from support.played import advance, stored
from support.reading import unreadable
from support.screen import Screen
from support.service_processes import Service
from support.stores import taken


@pytest.fixture(scope="module")
def locked(guarded: Callable[..., Any]) -> Iterator[Service]:
    with guarded("--coordinators", 0) as service:
        yield service


@pytest.fixture
def key(locked: Service) -> str:
    """A key of somebody new, with which the test, too, asks the service."""
    secret = made(locked, "read", "write")
    locked.client.headers["Authorization"] = f"Bearer {secret}"
    locked._dataset = ""
    return secret


def made(service: Service, *scopes: str, owner: str | None = None) -> str:
    with stored(service) as store:
        return store.keys.create("test", frozenset(scopes), owner)[1]


def enter(page: Any, secret: str) -> None:
    page.get_by_label("Key").fill(secret)
    page.keyboard.press("Enter")


@pytest.mark.ci
def test_a_key_is_asked_for_refused_if_wrong_and_kept_if_right(
    screens: Callable[..., Screen], locked: Service, key: str, expect: Any
) -> None:
    job = locked.submit(500, name="mine")
    page = screens(locked.url).go(f"#/jobs/{job}")
    expect(page.get_by_role("heading", name="This service asks for a key")).to_be_visible()
    expect(page.get_by_role("alert")).to_contain_text("this service needs a key")
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
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 360])
def test_the_question_can_be_read_by_everybody(
    screens: Callable[..., Screen], locked: Service, width: int, scheme: str
) -> None:
    page = screens(locked.url, width=width, color_scheme=scheme).go()
    page.get_by_label("Key").wait_for()
    assert unreadable(page) == []


@pytest.mark.ci
def test_the_key_stands_in_no_address(screens: Callable[..., Screen], locked: Service, key: str) -> None:
    screen = screens(locked.url)
    asked: list[str] = []
    screen.page.on("request", lambda request: asked.append(request.url))
    page = screen.go()
    enter(page, key)
    page.get_by_role("heading", name="No jobs yet").wait_for()
    assert len(asked) > 5
    assert not [url for url in [*asked, page.url] if key in url]


@pytest.mark.ci
def test_the_events_of_a_job_come_with_the_key(
    screens: Callable[..., Screen], locked: Service, key: str, expect: Any
) -> None:
    job = locked.submit(500)
    page = screens(locked.url).go(f"#/jobs/{job}")
    enter(page, key)
    with stored(locked) as store:
        lease = taken(store, job)
        for last in (5, 6, 7):
            advance(store, lease, last, last)
            expect(page.locator(".stand .words")).to_have_text(f"{last} / 500")


@pytest.mark.ci
def test_another_ones_jobs_are_not_seen(
    screens: Callable[..., Screen], locked: Service, key: str, expect: Any
) -> None:
    job = locked.submit(500, name="mine")
    page = screens(locked.url).go(f"#/jobs/{job}")
    enter(page, made(locked, "read"))
    expect(page.get_by_role("heading", name="There is no such job")).to_be_visible()
    page.get_by_role("link", name="Show all jobs").click()
    expect(page.get_by_role("heading", name="No jobs yet")).to_be_visible()


@pytest.mark.nightly
def test_a_revoked_key_is_asked_for_again_with_the_reason(
    screens: Callable[..., Screen], locked: Service, key: str, expect: Any
) -> None:
    page = screens(locked.url).go()
    enter(page, key)
    expect(page.get_by_role("heading", name="No jobs yet")).to_be_visible()
    with stored(locked) as store:
        store.keys.revoke(store.keys.find(key).id)
    expect(page.get_by_role("alert")).to_contain_text("the key was revoked")
    assert page.evaluate("sessionStorage.getItem('islands.key')") is None


@pytest.mark.nightly
def test_what_a_key_does_not_allow_is_said(
    screens: Callable[..., Screen], locked: Service, key: str, expect: Any
) -> None:
    job = locked.submit(500)
    with stored(locked) as store:
        owner = store.keys.find(key).owner
    page = screens(locked.url).go(f"#/jobs/{job}")
    enter(page, made(locked, "read", owner=owner))
    page.get_by_role("button", name="Cancel").click()
    banner = page.locator(".banner")
    expect(banner).to_contain_text("the key has the scopes read, but this request needs write")
    banner.get_by_role("button", name="Dismiss").click()
    expect(banner).to_have_count(0)
    assert locked.job(job)["state"] == "queued"
