"""Response of a model to inputs of choice on the page of a job, while sliders move."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from support.canvas import count_segments, get_lines
from support.played import run_submitted
from support.processes import eventually
from support.reading import unreadable
from support.service_client import ServiceClient

pytestmark = pytest.mark.ci


def get_response(page: Any) -> list[Any]:
    """Return the drawn line of the response."""
    return get_lines(page.locator(".try figure.chart").first)["y_um"]


@pytest.fixture(scope="module")
def finished(service: ServiceClient) -> str:
    """A succeeded job, executed by the test process."""
    return run_submitted(service, service.submit(5, name="piezo"))


@pytest.fixture
def tried(opened: Callable[..., Any], finished: str, expect: Any) -> Callable[..., Any]:
    """Function that opens the section, and returns the page with a first response."""

    def open_section(**options: Any) -> Any:
        page = opened(f"#/jobs/{finished}", **options)
        button = page.get_by_role("button", name="Try it")
        button.click()
        expect(button).to_have_attribute("aria-expanded", "true")
        # The first simulation of a service loads the kernels.
        expect(page.locator(".responses [role=status]")).to_contain_text("y_um: ", timeout=60_000)
        return page

    return open_section


def test_a_slider_changes_the_response_and_the_warning(tried: Callable[..., Any], expect: Any) -> None:
    page = tried()
    expect(page.locator(".try .warnings li")).to_have_count(0)
    eventually(lambda: count_segments(get_response(page)) > 50)
    before = get_response(page)
    slider = page.get_by_role("slider", name="Amplitude")
    value, text = page.get_by_label("Amplitude (").input_value(), slider.get_attribute("aria-valuetext")
    assert text.endswith(" V")
    slider.press("End")
    expect(page.locator(".try .warnings li").first).to_contain_text("in the estimation data")
    assert float(page.get_by_label("Amplitude (").input_value()) == pytest.approx(2 * float(value), rel=1e-3)
    assert slider.get_attribute("aria-valuetext") != text
    eventually(lambda: get_response(page) != before)
    page.get_by_label("Amplitude (").fill(value)
    expect(page.locator(".try .warnings li")).to_have_count(0)
    eventually(lambda: get_response(page) == before)


def test_the_last_value_of_a_moved_slider_wins(tried: Callable[..., Any], expect: Any) -> None:
    page = tried()
    asked: list[Any] = []
    page.on("request", lambda each: each.url.endswith("/simulate") and asked.append(each.post_data_json))
    slider = page.get_by_role("slider", name="Offset")
    slider.evaluate(
        """slider => {
          for (let at = 0; at <= 50; at += 1) {
            slider.value = Number(slider.min) + (at / 50) * (slider.max - slider.min);
            slider.dispatchEvent(new Event("input", { bubbles: true }));
          }
        }"""
    )
    typed = float(page.get_by_label("Offset (").input_value())
    while len(asked) < 2:
        page.wait_for_event("requestfinished")
    # The request that runs at the first change, and one for all changes meanwhile.
    assert len(asked) == 2
    assert asked[-1]["inputs"]["u_V"]["offset"] == typed
    expect(page.get_by_text("Before the first sample y_um is")).to_be_visible()


def test_files_of_inputs_alone_are_simulated_from_a_given_output(
    tried: Callable[..., Any], expect: Any, tmp_path: Path
) -> None:
    page = tried()
    files = [tmp_path / name for name in ("one.csv", "two.csv")]
    for factor, path in enumerate(files, start=1):
        rows = (f"{0.01 * k:.2f},{factor * (k % 50)}" for k in range(200))
        path.write_text("\n".join(["t_s,u_V", *rows]))
    form = page.locator(".scenarios")
    form.locator("input[type=file]").set_input_files(files)
    form.get_by_label("y_um before the first sample").fill("0.5")
    form.get_by_role("button", name="Simulate", exact=True).click()
    expect(form.get_by_role("status")).to_contain_text("two.csv: from y_um = 0.5", timeout=60_000)
    lines = get_lines(form.locator("figure.chart").first)
    assert set(lines) == {"one.csv", "two.csv"}
    with page.expect_download() as saved:
        form.get_by_role("button", name="Save one.csv simulated").click()
    assert Path(saved.value.path()).read_text().startswith("t_s,y_um\n0,")
    assert unreadable(page) == []


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 390)])
def test_the_section_fits_and_has_sufficient_contrast(
    tried: Callable[..., Any], scheme: str, width: int
) -> None:
    page = tried(width=width, color_scheme=scheme)
    page.get_by_role("slider", name="Amplitude").press("End")
    page.locator(".try .warnings li").first.wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert unreadable(page) == []
