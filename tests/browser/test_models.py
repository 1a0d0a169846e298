"""Models of a job on the dashboard: equation, metrics, figures and exports."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from support.coupled_systems import TWO_MASSES, make_coupled_record
from support.played import run_submitted
from support.processes import eventually
from support.reading import APPEARANCES, unreadable
from support.service_client import ServiceClient

#: Milliseconds in which a busy machine draws the figures of a model or of a search.
DRAWN = 120_000


@pytest.fixture(scope="module")
def finished(service: ServiceClient) -> str:
    """A succeeded job, executed by the test process."""
    return run_submitted(service, service.submit(10, name="piezo, 2 islands"))


@pytest.mark.ci
def test_a_finished_job_shows_its_models_with_their_metrics(
    opened: Callable[..., Any], service: ServiceClient, finished: str, expect: Any
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
        mark = " recommended" if model["recommended"] else ""
        assert cells[:2] == [f"{model['rank']}{mark}", str(model["size"])]
        assert cells[2] == f"{numbers[0]:#.3g}"
        assert cells[3] == f"{numbers[1]:.5f}".replace("-", "−")
        assert cells[7] == ("holds" if model["physics"]["property_1"] else "fails")
        assert cells[8] == model["residual_tests"]["verdict"]


@pytest.mark.ci
@pytest.mark.parametrize(("width", "height"), [(1440, 900), (390, 844)])
def test_a_result_begins_with_its_equation_and_its_free_run(
    opened: Callable[..., Any], finished: str, width: int, height: int
) -> None:
    result = opened(f"#/jobs/{finished}", width=width, height=height).get_by_role("region", name="Result")
    for part in (result.locator("math").first, result.get_by_role("slider")):
        part.wait_for()
        box = part.bounding_box()
        assert box["y"] + box["height"] <= height
    assert result.locator(".symbols").inner_text() == "y: y_um (um); u: u_V (V); k: samples of 0.01 s"


@pytest.mark.ci
def test_the_equation_is_mathml_that_matches_the_model(
    opened: Callable[..., Any], service: ServiceClient, finished: str, expect: Any
) -> None:
    model = json.loads(service.models(finished))["items"][1]
    page = opened(f"#/jobs/{finished}/models/2")
    math = page.locator(".model .equation math")
    expect(math).to_be_visible()
    assert math.evaluate("node => node instanceof MathMLElement && node.getClientRects().length > 0")
    text = math.text_content()
    for term in model["terms"]:
        assert f"{abs(term['parameter']):.6g}" in text
    terms = page.locator(".pair table").first.locator("tbody tr")
    assert terms.locator("th").all_text_contents() == [term["term"] for term in model["terms"]]
    exact = terms.locator("data").evaluate_all("all => all.map((one) => Number(one.value))")
    assert exact[::3] == [term["parameter"] for term in model["terms"]]


@pytest.mark.ci
def test_figures_are_loaded_when_they_scroll_into_view(
    opened: Callable[..., Any], finished: str, expect: Any
) -> None:
    page = opened("#/jobs")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    # A request waits until its route is removed.
    page.route("**/figures/*", lambda _route: None)
    page.goto(f"{page.url.partition('#')[0]}#/jobs/{finished}")
    expect(page.locator(".gallery .rendered")).to_have_count(4)
    page.wait_for_load_state("networkidle")
    assert not [url for url in asked if "/figures/" in url]
    page.locator(".rendered").first.scroll_into_view_if_needed()
    expect(page.get_by_text("Drawing…").first).to_be_visible()
    assert unreadable(page) == []
    page.unroute("**/figures/*")
    page.locator(".rendered").last.scroll_into_view_if_needed()
    expect(page.locator(".gallery img")).to_have_count(4, timeout=DRAWN)
    for name in ("Free run", "Output over input", "Held input", "Residual correlations"):
        picture = page.get_by_role("img", name=f"{name}, drawn by the service")
        expect(picture).to_be_visible()
        eventually(lambda shown=picture: shown.evaluate("img => img.complete && img.naturalWidth > 300"))
    page.get_by_text("Figures of the search").click()
    page.locator(".search .rendered").last.scroll_into_view_if_needed()
    expect(page.locator(".search img")).to_have_count(4, timeout=DRAWN)


@pytest.mark.nightly
@pytest.mark.parametrize(("scheme", "width"), APPEARANCES)
def test_the_models_panel_has_sufficient_contrast(
    opened: Callable[..., Any], finished: str, expect: Any, width: int, scheme: str
) -> None:
    page = opened(f"#/jobs/{finished}", width=width, color_scheme=scheme)
    expect(page.locator(".model .equation math")).to_be_visible()
    expect(page.locator(".gallery .rendered")).to_have_count(4)
    assert unreadable(page) == []


@pytest.mark.ci
def test_a_figure_is_saved_as_svg_png_and_csv(
    opened: Callable[..., Any], service: ServiceClient, finished: str, expect: Any
) -> None:
    page = opened(f"#/jobs/{finished}", color_scheme="dark")
    figure = page.locator("figure.rendered", has=page.get_by_role("heading", name="Residual correlations"))
    figure.scroll_into_view_if_needed()
    # The first request draws all figures.
    figure.get_by_role("img").wait_for(timeout=DRAWN)
    expect(figure.get_by_role("img")).to_have_css("filter", "invert(1) hue-rotate(180deg)")
    made = {}
    for form in ("SVG", "PNG", "CSV"):
        with page.expect_download() as saved:
            figure.get_by_role("link", name=f"Residual correlations as {form}").press("Enter")
        assert saved.value.suggested_filename == f"residuals.{form.lower()}"
        made[form] = saved.value.path().read_bytes()
    path = f"/v1/jobs/{finished}/models/{page.locator('h3#model').inner_text().split()[-1]}/figures/residuals"
    assert made["SVG"] == service.ask("GET", f"{path}.svg").content
    assert made["CSV"] == service.ask("GET", f"{path}.csv").content
    picture = Image.open(io.BytesIO(made["PNG"])).convert("RGB")
    assert picture.width == 2100  # 7 inches at 300 per inch
    assert picture.getpixel((2, 2)) == (255, 255, 255)
    assert picture.getcolors(maxcolors=1) is None


@pytest.mark.ci
def test_the_linear_system_of_a_model_is_shown_about_any_operating_point(
    opened: Callable[..., Any], service: ServiceClient, expect: Any, tmp_path: Path
) -> None:
    rng = np.random.default_rng(0)
    u, y = rng.normal(size=400), np.zeros(400)
    for k in range(1, 400):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1] - 0.02 * y[k - 1] ** 2
    content = "u_V,y_um\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in zip(u, y, strict=True))
    answer = service.ask("POST", "/v1/datasets", files={"file": ("slow.csv", content.encode())})
    job = service.submit(5, dataset=answer.json()["id"], dt=0.1, preset="narx", name="slow")
    page = opened(f"#/jobs/{run_submitted(service, job)}")
    page.get_by_text("Linear system: Bode").click()
    expect(page.locator(".modes li").first).to_contain_text("time constant", timeout=DRAWN)
    first = page.locator(".modes").inner_text()
    with page.expect_download() as saved:
        page.get_by_role("button", name="State space, MATLAB").click()
    assert "sys = ss(A, B, C, D, 0.1);" in Path(saved.value.path()).read_text()
    page.get_by_label("u_V").fill("1")
    page.get_by_role("button", name="Linearise there").click()
    expect(page.locator(".modes li").first).to_be_visible(timeout=DRAWN)
    eventually(lambda: page.locator(".modes").inner_text() != first)
    picture = page.get_by_role("img", name="Nyquist plot, drawn by the service")
    page.locator(".linear .rendered").nth(1).scroll_into_view_if_needed()
    expect(picture).to_be_visible(timeout=DRAWN)
    assert unreadable(page) == []


@pytest.fixture(scope="module")
def finished_outputs(service: ServiceClient, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A succeeded job of two outputs, and its file."""
    record = make_coupled_record(TWO_MASSES, samples=200, noise=0.01)
    path = tmp_path_factory.mktemp("outputs") / "masses.csv"
    columns = np.column_stack([0.1 * np.arange(200).round(3), record.records[0].u, record.y])
    np.savetxt(path, columns, delimiter=",", header="t_s,u,y1,y2", comments="")
    data = service.ask("POST", "/v1/datasets", files={"file": (path.name, path.read_bytes())}).json()
    settings = {"population": 8, "max_terms": 4, "library_degree": 1, "average": 1, "islands": 1}
    spec = {"preset": "narx", "inputs": ["u"], "output": ["y1", "y2"], "dataset": data["id"]}
    spec["settings"] = {**settings, "generations": 2}
    answer = service.ask("POST", "/v1/jobs", json=spec)
    return run_submitted(service, answer.json()["id"]), path


@pytest.mark.ci
@pytest.mark.parametrize(("scheme", "width"), [("dark", 1440), ("light", 390)])
def test_a_result_of_several_outputs_has_what_one_of_one_output_has_for_each(
    opened: Callable[..., Any],
    service: ServiceClient,
    finished_outputs: tuple[str, Path],
    expect: Any,
    scheme: str,
    width: int,
) -> None:
    job, path = finished_outputs
    page = opened(f"#/jobs/{job}", width=width, color_scheme=scheme)
    outputs = service.ask("GET", f"/v1/jobs/{job}/result").json()["outputs"]
    rows = page.get_by_role("table", name="Outputs, simulated together").locator("tbody tr")
    expect(rows).to_have_count(2)
    for output, row in zip(outputs, rows.all(), strict=True):
        free = [output["metrics"][part]["free_run"] for part in ("estimation", "validation")]
        shown = row.locator("data").evaluate_all("all => all.map((one) => Number(one.value))")
        assert shown == [number for part in free for number in (part["mape"], part["r2"])]
    for name in ("y1", "y2"):
        expect(page.locator(".sentences")).to_contain_text(f"{name}, error: RMSE")
    expect(page.locator("article math")).to_have_count(2)
    expect(page.get_by_role("button", name="MATLAB System")).to_be_visible()
    page.get_by_text("Linear system: Bode").click()
    expect(page.locator(".linear .modes li").first).to_contain_text("resonance at 0.6")
    form = page.locator(".scenarios")
    form.locator("input[type=file]").set_input_files(str(path))
    form.get_by_role("button", name="Simulate").click()
    expect(form.locator("figure.chart")).to_have_count(2, timeout=60_000)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert unreadable(page) == []
