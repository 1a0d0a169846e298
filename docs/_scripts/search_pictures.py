"""Pictures of a search in the README: errors of its islands, and its page of the service.

``python docs/_scripts/search_pictures.py`` draws ``docs/pictures/search.svg`` and
``docs/pictures/service.png`` again. It needs `make .venv/ready-test` and Chromium.
"""

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import sync_playwright

import islands
from islands.figures.convergence import draw_islands
from islands.figures.style import save
from islands.io.records.writer import write_record
from islands.systems.example_records import EXAMPLE_RECORDS

PICTURES = Path(__file__).parents[1] / "pictures"

CHROMIUM = "/usr/bin/chromium"

#: Islands of both searches, address of the service and size of its page.
ISLANDS, PORT = 8, 8765
WIDTH, HEIGHT = 1200, 790

#: Seconds that the service has to start.
PATIENCE = 60.0


def draw_search() -> None:
    """Draw the error of each island over the generations."""
    result = islands.identify(EXAMPLE_RECORDS["piezo"].make(), islands=ISLANDS)
    save(draw_islands(result.search_result), PICTURES / "search.svg")


def draw_service() -> None:
    """Run a job on a temporary service, and save a screenshot of the job's page."""
    url = f"http://127.0.0.1:{PORT}"
    with TemporaryDirectory() as folder:
        record = Path(folder) / "piezo.csv"
        write_record(EXAMPLE_RECORDS["piezo"].make(), record)
        command = [sys.executable, "-m", "islands"]
        service = subprocess.Popen([*command, "serve", "--port", str(PORT), "--data-dir", f"{folder}/data"])
        try:
            submit = [*command, "jobs", "submit", str(record), "--input", "u_V", "--output", "y_um"]
            submit += ["--islands", str(ISLANDS), "--watch", "--url", url]
            deadline = time.monotonic() + PATIENCE
            while subprocess.run(submit, check=False).returncode != 0:
                if time.monotonic() > deadline:
                    raise TimeoutError("the service did not run the job")
                time.sleep(1.0)
            save_page(url)
        finally:
            service.terminate()
            service.wait()


def save_page(url: str) -> None:
    """Save a screenshot of the page of the only job."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(url)
        page.locator("a[href^='#/jobs/']").first.click()
        page.locator("figure.chart").first.wait_for()
        page.wait_for_timeout(2_000)
        page.screenshot(path=PICTURES / "service.png")
        browser.close()


if __name__ == "__main__":
    draw_search()
    draw_service()
