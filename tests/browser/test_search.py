"""A real search on the page, from the submission to its figures, before a service that wants a key."""

import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from islands_service.store import Store
from support.processes import eventually
from support.reading import unreadable
from support.screen import Screen
from support.service_processes import Service, serving

pytestmark = pytest.mark.ci

#: What the page may take on its way: its files, and the list with what it shows. A job's history and models
#: come on top; they grow with the search.
MOST_BYTES = 120_000

#: Milliseconds until something is seen: 180 to 230 were measured on a busy machine.
MOST_MS = 2000

KEPT = "sessionStorage.setItem('islands.key', {})"

#: Bytes that were transferred, of the page's files and of data; the first contentful paint in milliseconds.
MEASURED = """() => {
  const entries = ["navigation", "resource"].flatMap((kind) => performance.getEntriesByType(kind));
  const total = (chosen) => chosen.reduce((sum, entry) => sum + entry.transferSize, 0);
  const data = entries.filter((entry) => entry.name.includes("/v1/"));
  const [paint] = performance.getEntriesByName("first-contentful-paint");
  return [total(entries) - total(data), total(data), paint.startTime];
}"""

#: Notes every state that a badge shows.
NOTED = """(selector) => {
  const badge = document.querySelector(selector);
  window.noted = [badge.textContent];
  new MutationObserver(() => window.noted.push(badge.textContent)).observe(badge, { childList: true });
}"""


@pytest.fixture(scope="module")
def service(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("search") / "data"
    folder.mkdir()
    with Store(f"sqlite:///{folder / 'islands.db'}") as store:
        _, secret = store.keys.create("test", frozenset({"read", "write"}))
    with serving(folder, "--require-keys") as service:
        service.client.headers["Authorization"] = f"Bearer {secret}"
        yield service


@pytest.fixture(scope="module")
def finished(service: Service) -> str:
    """A job that has succeeded."""
    job = service.submit(200, name="piezo, 2 islands")
    service.found(job)
    return job


@pytest.fixture
def opened(quiet: Callable[..., Screen], service: Service) -> Callable[..., Any]:
    """Opens an address with the key at hand."""

    def open_at(place: str, **options: Any) -> Any:
        screen = quiet(service.url, **options)
        secret = service.client.headers["Authorization"].removeprefix("Bearer ")
        screen.page.add_init_script(KEPT.format(json.dumps(secret)))
        return screen.go(place)

    return open_at


def test_a_search_is_watched_from_the_list_through_its_states(
    opened: Callable[..., Any], service: Service, finished: str, expect: Any
) -> None:
    page = opened("#/jobs")
    expect(page.locator("tbody tr")).not_to_have_count(0)
    job = service.submit(700, name="watched")
    badge = f"tr[data-job='{job}'] .state"
    expect(page.locator(badge)).to_be_visible()
    page.evaluate(NOTED, badge)
    expect(page.locator(badge)).to_have_text("succeeded", timeout=60_000)
    order = ["queued", "running", "succeeded"]
    noted = page.evaluate("noted")
    assert noted == [word for word in order if word in noted]
    assert "running" in noted
    page.get_by_role("link", name="watched").click()
    expect(page.locator(".stand .words")).to_have_text("700 / 700")


def test_a_finished_job_shows_its_models_with_the_metrics_of_the_service(
    opened: Callable[..., Any], service: Service, finished: str, expect: Any
) -> None:
    page = opened(f"#/jobs/{finished}")
    models = json.loads(service.models(finished))["items"]
    expect(page.locator("table.models tbody tr")).to_have_count(len(models))
    for model, row in zip(models, page.locator("table.models tbody tr").all(), strict=True):
        free = [model["metrics"][part]["free_run"] for part in ("estimation", "validation")]
        numbers = [number for part in free for number in (part["mape"], part["r2"])]
        shown = row.locator("data").evaluate_all("all => all.map((one) => Number(one.value))")
        assert shown == [*numbers, model["physics"]["hold_drift_percent"]]
        cells = row.locator("th, td").all_text_contents()
        assert cells[:2] == [str(model["rank"]), str(model["size"])]
        assert cells[2] == f"{numbers[0]:#.3g}"
        assert cells[3] == f"{numbers[1]:.5f}".replace("-", "−")
        assert cells[7] == ("holds" if model["physics"]["property_1"] else "fails")
        assert (cells[8] == "pass") == model["residual_tests"]["passed"]


def test_the_equation_is_mathematics_that_reads_as_the_model_does(
    opened: Callable[..., Any], service: Service, finished: str, expect: Any
) -> None:
    model = json.loads(service.models(finished))["items"][1]
    page = opened(f"#/jobs/{finished}/models/2")
    math = page.locator(".equation math")
    expect(math).to_be_visible()
    assert math.evaluate("node => node instanceof MathMLElement && node.getClientRects().length > 0")
    text = math.text_content()
    for term in model["terms"]:
        assert f"{abs(term['parameter']):.6g}" in text
    terms = page.locator(".pair table").first.locator("tbody tr")
    assert terms.locator("th").all_text_contents() == [term["regressor"] for term in model["terms"]]
    exact = terms.locator("data").evaluate_all("all => all.map((one) => Number(one.value))")
    assert exact[::2] == [term["parameter"] for term in model["terms"]]


def test_figures_are_drawn_when_they_come_into_sight(
    opened: Callable[..., Any], finished: str, expect: Any
) -> None:
    page = opened("#/jobs")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{page.url.partition('#')[0]}#/jobs/{finished}/models/3")
    expect(page.locator(".gallery .drawn")).to_have_count(4)
    page.wait_for_load_state("networkidle")
    assert not [url for url in asked if "/figures/" in url]
    page.locator(".drawn").first.scroll_into_view_if_needed()
    expect(page.get_by_text("Being drawn…").first).to_be_visible()
    page.locator(".drawn").last.scroll_into_view_if_needed()
    expect(page.locator(".gallery img")).to_have_count(4, timeout=60_000)
    for name in ("Free run", "Hysteresis loop", "Held input", "Residual correlations"):
        picture = page.get_by_role("img", name=f"{name}, drawn by the service")
        expect(picture).to_be_visible()
        eventually(lambda shown=picture: shown.evaluate("img => img.complete && img.naturalWidth > 300"))
    page.get_by_text("as figures for a report").click()
    page.locator(".search .drawn").last.scroll_into_view_if_needed()
    expect(page.locator(".search img")).to_have_count(4, timeout=60_000)


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 360])
def test_models_can_be_read_by_everybody(
    opened: Callable[..., Any], finished: str, expect: Any, width: int, scheme: str
) -> None:
    page = opened(f"#/jobs/{finished}", width=width, color_scheme=scheme)
    expect(page.locator(".equation math")).to_be_visible()
    expect(page.locator(".gallery .drawn")).to_have_count(4)
    assert unreadable(page) == []


def test_a_model_is_taken_along_as_a_file(
    opened: Callable[..., Any], service: Service, finished: str
) -> None:
    page = opened(f"#/jobs/{finished}/models/2")
    for button, form, name in (("C", "c", "model-02.c"), ("LaTeX", "latex", "model-02.tex")):
        with page.expect_download() as saved:
            page.get_by_role("button", name=button, exact=True).click()
        wanted = service.ask("GET", f"/v1/jobs/{finished}/models/2/export", params={"format": form})
        assert saved.value.suggested_filename == name
        assert saved.value.path().read_bytes() == wanted.content
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save the result").click()
    whole = service.ask("GET", f"/v1/jobs/{finished}/result").json()
    assert json.loads(saved.value.path().read_text()) == whole


def test_every_kind_of_export_has_its_button(opened: Callable[..., Any], finished: str, expect: Any) -> None:
    from islands.io.export import EXPORTS

    page = opened(f"#/jobs/{finished}")
    expect(page.locator(".take button")).not_to_have_count(0)
    shown = page.locator(".take button").evaluate_all("all => all.map((one) => one.dataset.format)")
    assert set(shown) == set(EXPORTS)


def test_another_model_is_chosen_without_leaving_and_kept_by_a_reload(
    opened: Callable[..., Any], finished: str, expect: Any
) -> None:
    page = opened(f"#/jobs/{finished}")
    expect(page.get_by_role("heading", name="Model 1")).to_be_visible()
    page.evaluate("document.querySelector('h1').dataset.same = 'yes'")
    page.get_by_role("link", name="Model 3").click()
    expect(page.get_by_role("heading", name="Model 3")).to_be_visible()
    assert page.locator("h1").get_attribute("data-same") == "yes"
    assert page.locator("table.models tr.current th").text_content() == "3"
    page.reload()
    expect(page.get_by_role("heading", name="Model 3")).to_be_visible()
    assert page.url.endswith(f"#/jobs/{finished}/models/3")
    page.go_back()
    expect(page.get_by_role("heading", name="Model 1")).to_be_visible()


def test_the_page_is_small_and_soon_there(opened: Callable[..., Any], finished: str, expect: Any) -> None:
    for place, ready in (("#/jobs", "tbody tr"), (f"#/jobs/{finished}", ".equation math")):
        page = opened(place)
        expect(page.locator(ready).first).to_be_visible()
        page.wait_for_load_state("networkidle")
        files, data, painted = page.evaluate(MEASURED)
        print(f"{place[:7]}: files {files} bytes, data {data} bytes, first paint {painted:.0f} ms")
        assert files + (data if place == "#/jobs" else 0) < MOST_BYTES
        assert painted < MOST_MS


def test_a_running_search_is_cancelled_from_the_page(
    opened: Callable[..., Any], service: Service, expect: Any
) -> None:
    job = service.submit(1_000_000)
    page = opened(f"#/jobs/{job}")
    expect(page.locator(".title .state")).to_have_text("running")
    expect(page.locator("figure.chart").first).to_be_visible(timeout=60_000)
    expect(page.locator("figure.chart .place").first).not_to_have_text("generation 0")
    page.get_by_role("button", name="Cancel").click()
    expect(page.locator(".title .state")).to_have_text("cancelled", timeout=60_000)
    assert service.job(job)["state"] == "cancelled"
    reached = int(service.job(job)["progress"]["generation"])
    shown = page.locator("figure.chart .place").first.text_content().split()[-1]
    assert 0 < int(shown) <= reached
