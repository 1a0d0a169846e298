"""Pictures of the page of the service: a data set, a running and a finished search, and a diagnosis.

``python docs/_scripts/page_pictures.py`` writes ``docs/pictures/page-*.png`` again. It needs
`make .venv/ready-test` and Chromium.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.error import URLError
from urllib.request import urlopen

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from islands.records.writer import write_record
from islands.systems.example_records import EXAMPLE_RECORDS

PICTURES = Path(__file__).parents[1] / "pictures"

CHROMIUM = "/usr/bin/chromium"

PORT = 8765
WIDTH, HEIGHT = 1200, 860

#: Seconds that the service has to start, and a job to end.
PATIENCE = 120.0

#: Generations of the search whose page is shown while it runs.
GENERATIONS = 4000


@contextmanager
def run_service(folder: Path) -> Iterator[str]:
    """Run a temporary service; yield the address of its page."""
    url = f"http://127.0.0.1:{PORT}"
    command = [
        sys.executable,
        "-m",
        "islands",
        "serve",
        "--port",
        str(PORT),
        "--data-dir",
        str(folder / "data"),
    ]
    service = subprocess.Popen(command)
    try:
        deadline = time.monotonic() + PATIENCE
        while not is_ready(url):
            if time.monotonic() > deadline:
                raise TimeoutError("the service did not start")
            time.sleep(0.5)
        yield url
    finally:
        service.terminate()
        service.wait()


def is_ready(url: str) -> bool:
    """Return whether the service accepts jobs."""
    try:
        with urlopen(f"{url}/readyz") as answer:
            return bool(answer.status == 200)
    except URLError:
        return False


def save(page: Page, name: str) -> None:
    """Save a screenshot of the visible part of the page, with 256 colours."""
    page.wait_for_timeout(1500)
    path = PICTURES / f"page-{name}.png"
    page.screenshot(path=path)
    Image.open(path).convert("RGB").quantize(256).save(path, optimize=True)


def upload(page: Page, url: str, folder: Path, name: str) -> None:
    """Upload an example, and show its page."""
    record = folder / f"{name}.csv"
    write_record(EXAMPLE_RECORDS[name].make(), record)
    page.goto(f"{url}/#/data")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose").first.click()
    chooser.value.set_files(record)
    page.locator(".signals canvas").wait_for()


def save_result(page: Page) -> None:
    """Identify with the defaults, and save the page of the result."""
    page.get_by_role("button", name="Identify", exact=True).click()
    page.locator(".result .equation math").wait_for(timeout=1000 * PATIENCE)
    page.locator(".result figure.chart path").first.wait_for(timeout=1000 * PATIENCE)
    page.evaluate("scrollTo(0, 0)")
    save(page, "result")


def save_search(page: Page) -> None:
    """Save the page of a search of two islands while it runs."""
    page.get_by_text("Settings", exact=True).first.click()
    page.get_by_label("Preset", exact=True).select_option("narx")
    page.get_by_text("Advanced settings").click()
    page.get_by_label("islands", exact=True).fill("2")
    page.get_by_label("generations", exact=True).fill(str(GENERATIONS))
    page.get_by_role("button", name="Identify", exact=True).click()
    page.get_by_text("Front of size against error").wait_for(timeout=1000 * PATIENCE)
    page.wait_for_timeout(20_000)
    save(page, "search")
    page.get_by_role("button", name="Cancel").click()
    page.get_by_text("cancelled").first.wait_for(timeout=1000 * PATIENCE)


def save_diagnosis(page: Page) -> None:
    """Diagnose a linear model, which lacks the hysteresis, and save the page of the result."""
    page.get_by_text("Diagnose a simulation").click()
    page.locator("select[name=simulation]").select_option("linear")
    page.locator("input[name=order]").fill("1")
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.locator(".outputs canvas").wait_for(timeout=1000 * PATIENCE)
    page.evaluate("scrollTo(0, 0)")
    save(page, "diagnosis")


def main() -> None:
    """Save all pictures."""
    with TemporaryDirectory() as name, run_service(Path(name)) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        upload(page, url, Path(name), "motor")
        save(page, "data")
        data = page.url
        save_result(page)
        page.goto(data)
        page.locator(".signals canvas").wait_for()
        save_search(page)
        upload(page, url, Path(name), "piezo")
        save_diagnosis(page)
        browser.close()


if __name__ == "__main__":
    main()
