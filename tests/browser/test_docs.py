"""Reference of the REST interface: every route and schema of ``openapi.json``, without requests outside."""

from collections.abc import Callable
from typing import Any

import pytest

from support.reading import APPEARANCES, unreadable
from support.screen import Screen
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci


@pytest.fixture
def docs(quiet: Callable[..., Screen], desk: ServiceClient) -> Callable[..., Any]:
    """Function that opens the reference; an error or a request to another origin fails the test."""
    return lambda place="docs", **options: quiet(desk.url, **options).go(place)


def test_every_operation_and_every_schema_is_an_entry(
    docs: Callable[..., Any], desk: ServiceClient, expect: Any
) -> None:
    document = desk.ask("GET", "/openapi.json").json()
    operations = [each for of in document["paths"].values() for each in of.values()]
    page = docs()
    expect(page.locator("details")).to_have_count(len(operations) + len(document["components"]["schemas"]))
    ids = page.locator("details").evaluate_all("all => all.map((entry) => entry.id)")
    assert set(ids) == {each["operationId"] for each in operations} | set(document["components"]["schemas"])


def test_an_operation_leads_by_keyboard_to_the_schema_of_its_body(
    docs: Callable[..., Any], expect: Any
) -> None:
    page = docs()
    submit = page.locator("#submit_v1_jobs_post")
    submit.locator("summary").press("Enter")
    expect(submit.get_by_role("row", name="idempotency-key")).to_contain_text("creates no second job")
    submit.get_by_role("link", name="JobRequest").press("Enter")
    schema = page.locator("#JobRequest")
    expect(schema).to_have_attribute("open", "")
    expect(schema.locator("summary")).to_be_focused()
    expect(schema.get_by_role("row", name="dataset").first).to_contain_text("string, required")


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_reference_is_readable(docs: Callable[..., Any], expect: Any, scheme: str, width: int) -> None:
    page = docs("docs#submit_v1_jobs_post", width=width, color_scheme=scheme)
    expect(page.locator("#submit_v1_jobs_post")).to_have_attribute("open", "")
    assert unreadable(page) == []
