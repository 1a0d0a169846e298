"""Picture of the page of a monitor: ``python docs/_scripts/monitor_picture.py`` draws it again.

It writes ``docs/pictures/monitor-page.png`` and needs `make .venv/ready-test` and Chromium.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from page_pictures import CHROMIUM, PATIENCE, PICTURES, PORT
from playwright.sync_api import sync_playwright

from islands.records.writer import write_record
from islands_api.client import Client

sys.path.insert(0, str(Path(__file__).parents[2]))
from lab.diagnosis.monitor import SIMULATION, make_record

#: Records, the first one with play at the input, and its size in N.
COUNT, ONSET, PLAY = 22, 17, 0.5

WIDTH, HEIGHT = 1100, 1180


def draw_monitor() -> None:
    """Run a temporary service with a monitor, and save a screenshot of the monitor's page."""
    url = f"http://127.0.0.1:{PORT}"
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "islands", "serve", "--port", str(PORT)]
        service = subprocess.Popen([*command, "--data-dir", f"{folder}/data"])
        try:
            with Client(url, retry=PATIENCE) as client:
                save_page(f"{url}/#/monitors/{follow_records(client, Path(folder))}")
        finally:
            service.terminate()
            service.wait()


def follow_records(client: Client, folder: Path) -> str:
    """Diagnose a record, and let a monitor analyse further ones; return the id of the monitor."""
    rng = np.random.default_rng(3)
    first = folder / "first.csv"
    write_record(make_record(rng, 0.0), first)
    columns = {"simulation": SIMULATION, "input": "F", "output": "x"}
    job = client.wait(client.diagnose(client.upload(first), **columns))
    monitor = client.create_monitor(job, interval=3600.0, training=14, name="press 4")
    for index in range(COUNT):
        path = folder / f"press_2026-11-02T{index:02d}-00.csv"
        write_record(make_record(rng, 0.0, play=PLAY if index >= ONSET else 0.0), path)
        added = client.add_record(monitor, client.upload(path), time=f"2026-11-02T{index:02d}:00:00")
    client.wait(added)
    return monitor.id


def save_page(address: str) -> None:
    """Save a screenshot of the page of a monitor."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(address)
        page.locator("figure.chart").first.wait_for()
        page.wait_for_timeout(1_000)
        page.screenshot(path=PICTURES / "monitor-page.png")
        browser.close()


if __name__ == "__main__":
    draw_monitor()
