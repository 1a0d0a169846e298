"""Instructions for the first job: the three commands on the page work as written."""

from typing import Any

import pytest

from support.reading import unreadable
from support.screen import Screen
from support.service_client import ServiceClient


@pytest.fixture(scope="module")
def commands(chromium: Any, desk: ServiceClient) -> dict[str, str]:
    """Commands by heading, read from the page of a service without jobs."""
    screen = Screen(chromium.new_page(), desk.url)
    page = screen.go()
    page.get_by_role("heading", name="No jobs yet").wait_for()
    for width in (1280, 360):
        page.set_viewport_size({"width": width, "height": 800})
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            assert unreadable(page) == [], (width, scheme)
    names = page.locator(".welcome h3").all_text_contents()
    found = dict(zip(names, page.locator(".welcome pre").all_text_contents(), strict=True))
    page.close()
    assert screen.complaints == []
    return found


@pytest.mark.ci
def test_the_instructions_disappear_with_the_first_job(
    chromium: Any, commands: dict[str, str], desk: ServiceClient, expect: Any
) -> None:
    assert list(commands) == ["Command line", "Python", "curl"]
    assert all(desk.url in text for text in commands.values())
    job = desk.submit(500)
    page = Screen(chromium.new_page(), desk.url).go()
    expect(page.locator(f"tr[data-job='{job}']")).to_be_visible()
    expect(page.get_by_role("heading", name="No jobs yet")).to_have_count(0)
    page.close()
