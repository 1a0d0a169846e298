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

import numpy as np
from playwright.sync_api import Page, sync_playwright

from islands.systems.example_records import EXAMPLE_RECORDS

PICTURES = Path(__file__).parents[1] / "pictures"

CHROMIUM = "/usr/bin/chromium"

PORT = 8765
WIDTH, HEIGHT = 1200, 860

#: Seconds that the service has to start, and a job to end.
PATIENCE = 120.0

#: Generations of the search whose page is shown while it runs.
GENERATIONS = 4000


def write_motor(folder: Path) -> Path:
    """Write the record of the motor with a simulation of it that lacks the friction."""
    record = EXAMPLE_RECORDS["motor"].make()
    drive, speed = record.u[:, 0], record.y
    simulated = np.zeros_like(speed)
    for k in range(1, len(speed)):
        simulated[k] = 0.95 * simulated[k - 1] + 0.8 * drive[k - 1]
    rows = (
        f"{k * record.dt:.2f},{u:.5g},{y:.5g},{s:.5g}"
        for k, (u, y, s) in enumerate(zip(drive, speed, simulated, strict=True))
    )
    path = folder / "motor.csv"
    path.write_text("\n".join(["t_s,drive_V,speed_rad_s,simulated_rad_s", *rows]))
    return path


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
    """Save a screenshot of the visible part of the page."""
    page.wait_for_timeout(1500)
    page.screenshot(path=PICTURES / f"page-{name}.png")


def save_data(page: Page, url: str, record: Path) -> None:
    """Upload the record, choose its columns, and save the page of the data set."""
    page.goto(url)
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Choose").first.click()
    chooser.value.set_files(record)
    page.locator(".signals canvas").wait_for()
    page.get_by_label("drive_V is an input").check()
    page.get_by_label("speed_rad_s is the output").check()
    if page.get_by_label("simulated_rad_s is an input").is_checked():
        page.get_by_label("simulated_rad_s is an input").uncheck()
    page.evaluate("scrollTo(0, 0)")
    save(page, "data")


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
    """Diagnose the recorded simulation, and save the page of the result."""
    page.get_by_text("Diagnose a simulation").click()
    page.get_by_role("button", name="Diagnose", exact=True).click()
    page.locator(".outputs canvas").wait_for(timeout=1000 * PATIENCE)
    page.evaluate("scrollTo(0, 0)")
    save(page, "diagnosis")


def main() -> None:
    """Save all pictures."""
    with TemporaryDirectory() as name, run_service(Path(name)) as url, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        save_data(page, url, write_motor(Path(name)))
        data = page.url
        for save_next in (save_result, save_search, save_diagnosis):
            page.goto(data)
            page.get_by_label("drive_V is an input").check()
            page.get_by_label("speed_rad_s is the output").check()
            save_next(page)
        browser.close()


if __name__ == "__main__":
    main()
