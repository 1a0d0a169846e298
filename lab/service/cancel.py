"""Time from a cancellation at a random moment until the job is cancelled and none of its processes computes.

    python -m lab.service.cancel [MEASURE ...] [--repeat 20] [--json FILE]

Measures: diagnosis, identification; both by default.
"""

import os
import random
import re
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from lab.service.table import Figure, run
from support.processes import descendants
from support.service import KNOWN, held, hidden
from support.service_client import TERMINAL
from support.service_processes import Service, serving

#: Seconds of the record, whose diagnosis and identification take a while.
RECORD_SECONDS = 150.0

#: Seconds of an observation, and fraction of a core that counts as computing.
WINDOW, BUSY = 0.1, 0.3

#: Command lines of processes that compute for a job. Ray renames those that are idle.
WORKERS = re.compile("ray::(?!IDLE)")


def diagnosis(repeat: int) -> Iterator[Figure]:
    """Measure the cancellation of a diagnosis of a simulation that lacks an effect."""
    yield from _cancelled(
        repeat, "diagnosis", "/v1/discrepancies", lambda it: held(it, channels=["T_K"], tolerance=KNOWN)
    )


def identification(repeat: int) -> Iterator[Figure]:
    """Measure the cancellation of an identification with the preset auto, most of which is no search."""
    yield from _cancelled(repeat, "identification", "/v1/jobs", _identification)


def _identification(dataset: str) -> dict[str, object]:
    settings = {"islands": 2, "generations": 30, "population": 100}
    return {"dataset": dataset, "inputs": ["u_V"], "output": "y_um", "settings": settings}


def _cancelled(
    repeat: int, kind: str, path: str, make_request: Callable[[str], dict[str, object]]
) -> Iterator[Figure]:
    moments, cancelled, idle = random.Random(1), [], []
    with (
        tempfile.TemporaryDirectory(prefix="islands-cancel-", ignore_cleanup_errors=True) as folder,
        serving(Path(folder) / "data") as running,
    ):
        files = {"file": ("hidden.csv", hidden(Path(folder), RECORD_SECONDS))}
        request = make_request(running.ask("POST", "/v1/datasets", files=files).json()["id"])
        for _ in range(2):  # the first run reads all files from the disk
            began = time.monotonic()
            running.ended(running.ask("POST", path, json=request).json()["id"])
            seconds = time.monotonic() - began
        while len(cancelled) < repeat:
            job = running.ask("POST", path, json=request).json()["id"]
            time.sleep(moments.uniform(0.0, seconds))
            if running.job(job)["state"] in TERMINAL:
                continue
            began = time.monotonic()
            running.ask("POST", f"/v1/jobs/{job}/cancel")
            running.ended(job)
            cancelled.append(time.monotonic() - began)
            idle.append(max(cancelled[-1], _last_busy(running) - began))
        restarts = running.log.read_text().count("job abandoned")
    yield Figure(f"{kind}: cancelled", "s", 1.5, tuple(cancelled))
    yield Figure(f"{kind}: no worker computes ({restarts} restarts)", "s", 1.5, tuple(idle))


def _last_busy(running: Service) -> float:
    """Return the time at which a worker has computed last, within three seconds."""
    last, before, until = 0.0, _cpu_seconds(running), time.monotonic() + 3.0
    while time.monotonic() < until:
        time.sleep(WINDOW)
        now = _cpu_seconds(running)
        if any(spent - before.get(pid, spent) > BUSY * WINDOW for pid, spent in now.items()):
            last = time.monotonic()
        before = now
    return last


def _cpu_seconds(running: Service) -> dict[int, float]:
    """Return the processor time of each worker."""
    found = {}
    for pid, line in descendants(running.process.pid).items():
        if WORKERS.search(line):
            try:
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            except OSError:  # the process has ended
                continue
            found[pid] = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return found


MEASURES = {"diagnosis": diagnosis, "identification": identification}

if __name__ == "__main__":
    sys.exit(run(MEASURES, __doc__))  # type: ignore[arg-type]
