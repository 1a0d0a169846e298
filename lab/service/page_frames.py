"""Frames per second of the page in Chromium: zoom and pan over a long record, and a search with ten islands.

    python -m lab.service.page_frames [MEASURE ...] [--repeat 5] [--json FILE]

Measures: zoom, live; both by default. Counted are the frames of `requestAnimationFrame` around which the page
changed or a canvas was drawn, not those of an idle page. The browser renders in software, and the machine
must be idle. A search of ten islands on this machine sends one event in a second: `live` records its events,
its history and its free run, and feeds them to the page faster, again and again with growing generations. It
needs `make .venv/ready-test` and Chromium.
"""

import asyncio
import json
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import median
from threading import Thread
from typing import Any

import numpy as np
from playwright.async_api import CDPSession, Page, async_playwright

from islands_service.liveness import StopRequest
from islands_service.settings import ServiceSettings
from lab.service.table import Figure, percentile, run
from support.coordinators import SerialCoordinator
from support.service_processes import Service, serving

CHROMIUM = "/usr/bin/chromium"

#: Targets: milliseconds of a frame at the 95th percentile, and frames per second.
FRAME_MS, FRAMES_PER_SECOND = 20.0, 59.0

#: Samples of the record.
SAMPLES = 1_000_000

#: Events of the wheel in a direction and of a drag, and seconds between two of them, as of a mouse.
GESTURE, INPUT_PERIOD = 80, 0.008

#: Seconds after a gesture in which the samples of the service arrive.
REST = 0.25

#: Events of a second, ten times the largest rate of a search, and number of those whose frames are measured.
EVENT_RATE, MEASURED_EVENTS = 20, 400

#: Events after which the memory of the page is compared; the history has its largest length at both.
MEMORY_EVENTS = (1_200, 10_200)

#: Events of a second between both.
MEMORY_RATE = 100

#: Records the time of every frame, and whether the page changed or a canvas was drawn since the frame before.
RECORD = """() => {
  window.recorded = [];
  let changed = false;
  new MutationObserver(() => { changed = true; }).observe(document.querySelector("main"),
    { subtree: true, childList: true, attributes: true, characterData: true });
  const { stroke } = CanvasRenderingContext2D.prototype;
  CanvasRenderingContext2D.prototype.stroke = function note(...path) {
    changed = true;
    stroke.apply(this, path);
  };
  const note = (time) => {
    recorded.push([time, changed]);
    changed = false;
    requestAnimationFrame(note);
  };
  requestAnimationFrame(note);
}"""

#: Answers requests for a job in the page: its document, its history, the free run of its best model, and a
#: stream that `feed` fills.
REPLAY = """([job, progress, history, freeRun]) => {
  const send = window.fetch;
  let [generation, stream] = [0, null];
  const encoder = new TextEncoder();
  const scale = (values, at) => values.map((each) => each / (1 + at / 500));
  const makePoint = (at) => {
    const point = history[at % history.length];
    return { ...point, generation: at, islands: scale(point.islands, at) };
  };
  const makeProgress = (at) => {
    const one = progress[at % progress.length];
    const front = one.front.map((each) => ({ ...each, error: each.error / (1 + at / 500) }));
    return { ...one, generation: at, evaluations: 200 * at, islands: scale(one.islands, at), front };
  };
  const respond = (body) => new Response(JSON.stringify(body), { headers: { ETag: '"1"' } });
  window.fetch = (path, options) => {
    if (!path.startsWith(`v1/jobs/${job.id}`)) return send(path, options);
    const after = /history\\?after=(-?\\d+)/.exec(path);
    if (after) {
      const [first, count] = [Number(after[1]) + 1, Math.min(500, generation - Number(after[1]))];
      return respond({ items: Array.from({ length: count }, (_, at) => makePoint(first + at)) });
    }
    if (path.endsWith("/free-run")) return respond(freeRun);
    if (!path.endsWith("/events")) return respond(job);
    return new Response(new ReadableStream({ start: (opened) => { stream = opened; } }));
  };
  window.feed = async (events, period) => {
    while (stream === null) await new Promise((resolve) => setTimeout(resolve, 20));
    await new Promise((resolve) => {
      const timer = setInterval(() => {
        generation += 1;
        const data = JSON.stringify(makeProgress(generation));
        const id = job.version + generation;
        stream.enqueue(encoder.encode(`id: ${id}\\nevent: progress\\ndata: ${data}\\n\\n`));
        events -= 1;
        if (events > 0) return;
        clearInterval(timer);
        resolve();
      }, period);
    });
  };
}"""


@asynccontextmanager
async def open_page() -> AsyncIterator[tuple[Page, CDPSession]]:
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"]
        )
        page = await browser.new_page(viewport={"width": 1440, "height": 900})
        session = await page.context.new_cdp_session(page)
        # Processor time of the main thread, which other processes do not lengthen.
        await session.send("Performance.enable", {"timeDomain": "threadTicks"})
        yield page, session
        await browser.close()


async def read_metrics(session: CDPSession) -> dict[str, float]:
    answer = await session.send("Performance.getMetrics")
    return {each["name"]: each["value"] for each in answer["metrics"]}


async def measure(
    page: Page, session: CDPSession, act: Callable[[], Coroutine[Any, Any, None]]
) -> dict[str, float]:
    """Return the figures of the frames during an action."""
    await page.evaluate(RECORD)
    before = await read_metrics(session)
    await act()
    after = await read_metrics(session)
    recorded = await page.evaluate("window.recorded")
    frames = [
        end - begin
        for (begin, _), (end, changed), (_, later) in zip(recorded, recorded[1:], recorded[2:], strict=False)
        # A change delays the frame that it precedes, or the one behind that.
        if changed or later
    ]
    spent = {
        name: 1e3 * (after[name] - before[name]) / len(frames) for name in ("ScriptDuration", "TaskDuration")
    }
    return {
        "frames per second": 1e3 * len(frames) / sum(frames),
        "frame, median": median(frames),
        "frame, 95th percentile": percentile(frames, 0.95),
        "script in a frame": spent["ScriptDuration"],
        "main thread in a frame": spent["TaskDuration"],
    }


def to_figures(name: str, runs: list[dict[str, float]]) -> Iterator[Figure]:
    for key in runs[0]:
        values = tuple(each[key] for each in runs)
        if key == "frames per second":
            yield Figure(f"{name}: {key}", "/s", FRAMES_PER_SECOND, values, most=False)
        else:
            yield Figure(f"{name}: {key}", "ms", FRAME_MS if "percentile" in key else None, values)


def write_long_record(path: Path) -> None:
    rng = np.random.default_rng(1)
    u = np.repeat(rng.uniform(-1, 1, SAMPLES // 50), 50)
    i = 0.5 * u + rng.normal(0, 0.01, SAMPLES)
    y = np.cumsum(u) / 100 + rng.normal(0, 0.02, SAMPLES)
    rows = np.column_stack([0.001 * np.arange(SAMPLES), u, i, y])
    np.savetxt(path, rows, "%.6g", ",", header="time_s,u_V,i_A,y_mm", comments="")


async def zoom_and_drag(page: Page, session: CDPSession) -> None:
    """Zoom in, drag to the left and back, and zoom out."""
    box = await page.locator(".signals").bounding_box()
    assert box is not None, "the page has no plot"
    x, y = box["x"] + 0.6 * box["width"], box["y"] + 80
    away = range(GESTURE)
    drag = [{"type": "mouseMoved", "x": x - 3 * at, "y": y, "button": "left", "buttons": 1} for at in away]
    wheel = {"type": "mouseWheel", "x": x, "y": y, "deltaX": 0}
    await page.mouse.move(x, y)
    await send_input(session, [{**wheel, "deltaY": -25} for _ in away])
    await page.mouse.down()
    await send_input(session, [*drag, *reversed(drag)])
    await page.mouse.up()
    await send_input(session, [{**wheel, "deltaY": 25} for _ in away])


async def send_input(session: CDPSession, events: list[dict[str, Any]]) -> None:
    """Send events at the rate of a mouse, whether or not the page has handled those before."""
    sent = []
    for event in events:
        sent.append(asyncio.create_task(session.send("Input.dispatchMouseEvent", event)))
        await asyncio.sleep(INPUT_PERIOD)
    await asyncio.gather(*sent)
    await asyncio.sleep(REST)


async def measure_zoom(service: Service, dataset: str) -> dict[str, float]:
    async with open_page() as (page, session):
        await page.goto(f"{service.url}/#/data/{dataset}")
        await page.locator(".signals + .position", has_text="rows").wait_for(timeout=60_000)
        await page.locator(".signals").focus()
        return await measure(page, session, lambda: zoom_and_drag(page, session))


def zoom(repeat: int) -> Iterator[Figure]:
    """Zoom and pan over the record, whose samples the service reads once."""
    with (
        tempfile.TemporaryDirectory(prefix="islands-frames-") as folder,
        serving(Path(folder) / "data", "--coordinators", 0) as service,
    ):
        path = Path(folder) / "long.csv"
        write_long_record(path)
        answer = service.ask("POST", "/v1/datasets", files={"file": (path.name, path.read_bytes())})
        dataset = answer.json()["id"]
        runs = [asyncio.run(measure_zoom(service, dataset)) for _ in range(repeat + 1)]
    yield from to_figures(f"zoom and pan, {SAMPLES} samples", runs[1:])


def record_search(service: Service) -> tuple[dict[str, Any], list[Any], list[Any], dict[str, Any]]:
    """Return a running job of ten islands, its events with a front, its history, and its free run."""
    stopping = StopRequest()
    settings = ServiceSettings(data_dir=service.folder)
    thread = Thread(target=SerialCoordinator(settings, "me", stopping).run)
    thread.start()
    try:
        job = service.submit(100_000, settings={"islands": 10, "population": 20, "migrate_every": 5})
        progress: list[Any] = []
        while len(progress) < 4:
            time.sleep(0.5)
            document = service.job(job)
            found = document["progress"] or {}
            if found.get("migration") and found not in progress:
                progress.append(found)
        history = service.ask("GET", f"/v1/jobs/{job}/history?after=-1").json()["items"]
        free_run = service.ask("GET", f"/v1/jobs/{job}/free-run").json()
        service.ask("POST", f"/v1/jobs/{job}/cancel")
        service.ended(job)
    finally:
        stopping.request()
        thread.join()
    return document, progress, history, free_run


async def measure_live(service: Service, recorded: tuple[Any, ...], memory: bool) -> dict[str, float]:
    async with open_page() as (page, session):
        await page.add_init_script(f"({REPLAY})({json.dumps(recorded)})")
        await page.goto(f"{service.url}/#/jobs/{recorded[0]['id']}")

        async def feed(events: int, rate: float) -> None:
            await page.evaluate("([events, period]) => feed(events, period)", [events, 1e3 / rate])

        if memory:
            return await measure_memory(session, feed)
        # A history of its largest length takes longest to draw.
        await feed(1, 1.0)
        await feed(MEMORY_EVENTS[0] - MEASURED_EVENTS - 1, 1e3)
        await asyncio.sleep(5)
        return await measure(page, session, lambda: feed(MEASURED_EVENTS, EVENT_RATE))


async def measure_memory(
    session: CDPSession, feed: Callable[[int, float], Coroutine[Any, Any, None]]
) -> dict[str, float]:
    found, fed = [], 0
    for events in MEMORY_EVENTS:
        await feed(events - fed, MEMORY_RATE)
        fed = events
        await asyncio.sleep(5)
        await session.send("HeapProfiler.collectGarbage")
        metrics = await read_metrics(session)
        found.append((metrics["JSHeapUsedSize"] / 1e6, metrics["Nodes"], metrics["JSEventListeners"]))
    (first, nodes, listeners), (last, more, others) = found
    return {"memory": first, "growth": last - first, "nodes": more - nodes, "listeners": others - listeners}


def live(repeat: int) -> Iterator[Figure]:
    """Follow a search of ten islands: frames, and the memory of the page."""
    with (
        tempfile.TemporaryDirectory(prefix="islands-frames-", ignore_cleanup_errors=True) as folder,
        serving(Path(folder) / "data", "--coordinators", 0) as service,
    ):
        recorded = record_search(service)
        # The job of the page runs, whatever became of the recorded one.
        runs = [asyncio.run(measure_live(service, recorded, False)) for _ in range(repeat)]
        yield from to_figures(f"ten islands, {EVENT_RATE} events/s", runs)
        grown = asyncio.run(measure_live(service, recorded, True))
    events = "{} to {} events".format(*MEMORY_EVENTS)
    yield Figure("ten islands: memory of the page", "MB", None, (grown["memory"],))
    yield Figure(f"ten islands: its growth, {events}", "MB", 0.5, (grown["growth"],))
    yield Figure(f"ten islands: more nodes, {events}", "", 50.0, (grown["nodes"],))
    yield Figure(f"ten islands: more event listeners, {events}", "", 10.0, (grown["listeners"],))


MEASURES = {"zoom": zoom, "live": live}

if __name__ == "__main__":
    sys.exit(run(MEASURES, __doc__))  # type: ignore[arg-type]
