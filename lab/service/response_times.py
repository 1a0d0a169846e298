"""Seconds between a command or a request and its answer, in several checkouts in turn.

    python -m lab.service.response_times [ROW ...] [--checkout PATH ...] [--repeat 5] [--json FILE]

Each repetition runs a row once in each checkout, so that a slow moment of the machine meets all of them. The
table shows the medians and, for all checkouts but the first, their ratio to the first. Commands and requests
come from the command line and the REST interface of a checkout, whose names are stable. The machine must be
idle; caches of kernels are warm.
"""

import argparse
import json
import os
import re
import secrets
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from islands.records.writer import write_record
from islands.systems.catalogue import make_record

PIEZO = ("--input", "u_V", "--output", "y_um")
PAIR = ("--input", "u", "--output", "y")
#: Search of the paper's case 1 with one island, for the rate of individuals.
RATE = ("--preset", "paper-case1", "--islands", "1", "--generations", "150", "--engine", "serial")
#: Seconds during which the processor time of a service at rest is measured.
REST_SECONDS = 20.0
#: Seconds after the last job until a service is at rest.
SETTLING_SECONDS = 30.0
TICKS = os.sysconf("SC_CLK_TCK")

Row = Callable[["Checkout"], Mapping[str, float]]


class Checkout:
    """Installed checkout, and a folder with records for its commands."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.name = path.name
        self.islands = path / ".venv/bin/islands"
        if not self.islands.exists():
            raise SystemExit(f"{path} has no environment: run `make .venv/ready-test` in it")
        self.folder = folder
        # Each checkout has its own cache of compiled kernels.
        self.environment = {**os.environ, "ISLANDS_COLOR": "never", "XDG_CACHE_HOME": str(folder / "cache")}
        self.environment.pop("PYTHONDONTWRITEBYTECODE", None)
        write_records(folder)

    def run(self, *arguments: str) -> float:
        """Run a command; return its seconds."""
        began = time.perf_counter()
        done = subprocess.run(
            [self.islands, *arguments],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        seconds = time.perf_counter() - began
        if done.returncode:
            raise SystemExit(f"{self.name}: islands {' '.join(arguments)} failed:\n{done.stderr}")
        return seconds


def write_records(folder: Path) -> None:
    """Write the records of all rows: a piezo actuator with hysteresis, and processes with noise."""
    piezo = make_record("bouc-wen-piezo", "authors", "estimation")
    write_record(piezo, folder / "piezo.csv")
    write_lag(folder / "lag.csv")
    for samples in (500, 2_000, 3_000, 20_000, 100_000):
        rng = np.random.default_rng(1)
        u = np.repeat(rng.uniform(-1, 1, samples // 10), 10)
        y = np.zeros(samples)
        for k in range(2, samples):
            y[k] = 1.2 * y[k - 1] - 0.4 * y[k - 2] + 0.2 * u[k - 1] + 0.1 * u[k - 1] ** 2
        y += rng.normal(0, 0.005, samples)
        time_s = 0.01 * np.arange(samples)
        lines = [f"{t:.2f},{a:.6g},{b:.6g}" for t, a, b in zip(time_s, u, y, strict=True)]
        (folder / f"process{samples}.csv").write_text("time_s,u,y\n" + "\n".join(lines) + "\n")


def write_lag(path: Path) -> None:
    """Write a record of a lag of first order with a slow sine that a lag does not explain."""
    rng = np.random.default_rng(2)
    u, y = np.repeat(rng.uniform(-1, 1, 150), 20), np.zeros(3_000)
    for k in range(1, 3_000):
        y[k] = 0.95 * y[k - 1] + 0.05 * u[k - 1]
    y += 0.1 * np.sin(2 * np.pi * np.arange(3_000) / 600) + rng.normal(0, 0.01, 3_000)
    lines = [f"{0.01 * k:.2f},{a:.6g},{b:.6g}" for k, (a, b) in enumerate(zip(u, y, strict=True))]
    path.write_text("time_s,u,y\n" + "\n".join(lines) + "\n")


def command(name: str, *arguments: str, out: bool = False) -> Row:
    def row(checkout: Checkout) -> dict[str, float]:
        with tempfile.TemporaryDirectory(dir=checkout.folder) as folder:
            options = ("--out", str(Path(folder) / "out")) if out else ()
            return {f"{name}, s": checkout.run(*arguments, *options)}

    return row


def reads_fit(name: str, *arguments: str, out: bool = False) -> Row:
    """Return a row whose command reads a fit, which is made once."""
    once = command(name, *arguments, out=out)

    def row(checkout: Checkout) -> Mapping[str, float]:
        if not (checkout.folder / "fitted").exists():
            checkout.run("fit", "process500.csv", *PAIR, "--out", "fitted")
        return once(checkout)

    return row


def rate(samples: int) -> Row:
    """Return a row for the individuals per second of one island, from the times of its last generations."""

    def row(checkout: Checkout) -> dict[str, float]:
        with tempfile.TemporaryDirectory(dir=checkout.folder) as folder:
            out = Path(folder) / "out"
            checkout.run("identify", f"process{samples}.csv", *PAIR, *RATE, "--seed", "1", "--out", str(out))
            search = json.loads((out / "result.json").read_text())["search"]
        return {f"individuals/s, {samples} samples": search["evaluations_per_second"]}

    return row


class Service:
    """Running service of a checkout."""

    def __init__(self, checkout: Checkout, folder: Path) -> None:
        self._log = (folder / "log").open("wb")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.url = f"http://127.0.0.1:{port}"
        self.process = subprocess.Popen(
            [checkout.islands, "serve", "--port", str(port), "--data-dir", str(folder / "data")],
            env=checkout.environment,
            stdout=self._log,
            stderr=subprocess.STDOUT,
        )
        while True:
            if self.process.poll() is not None:
                raise SystemExit((folder / "log").read_text())
            try:
                if self.ask("/readyz")["status"] == "ready":
                    return
            except OSError:
                time.sleep(0.1)

    def close(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        self.process.wait()
        self._log.close()

    def ask(self, path: str, body: bytes | None = None, kind: str = "application/json") -> dict[str, Any]:
        request = urllib.request.Request(self.url + path, body, {"Content-Type": kind})
        with urllib.request.urlopen(request) as answer:
            found: dict[str, Any] = json.load(answer)
        return found

    def upload(self, path: Path) -> str:
        boundary = secrets.token_hex(8)
        head = f'--{boundary}\r\nContent-Disposition: form-data; name="file"; filename="{path.name}"\r\n\r\n'
        form = head.encode() + path.read_bytes() + f"\r\n--{boundary}--\r\n".encode()
        answer = self.ask("/v1/datasets", form, f"multipart/form-data; boundary={boundary}")
        return str(answer["id"])

    def run_job(self, dataset: str, **spec: Any) -> None:
        body = {"dataset": dataset, "inputs": ["u"], "output": "y", **spec}
        job = self.ask("/v1/jobs", json.dumps(body).encode())["id"]
        while (state := self.ask(f"/v1/jobs/{job}"))["state"] in ("queued", "running"):
            time.sleep(0.02)
        if state["state"] != "succeeded":
            raise SystemExit(json.dumps(state, indent=2))

    def processes(self) -> list[int]:
        """Return the process of the service and all processes below it."""
        children: dict[int, list[int]] = {}
        for each in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = each.read_text().rpartition(")")[2].split()
            except OSError:
                continue
            children.setdefault(int(fields[1]), []).append(int(each.parent.name))
        found = [self.process.pid]
        for pid in found:
            found += children.get(pid, [])
        return found

    def memory(self) -> float:
        """Return the proportional set size of all processes in MB."""
        total = 0
        for pid in self.processes():
            try:
                text = Path(f"/proc/{pid}/smaps_rollup").read_text()
            except OSError:
                continue
            total += int(re.findall(r"^Pss:\s+(\d+)", text, re.MULTILINE)[0])
        return total / 1e3

    def processor_seconds(self) -> float:
        total = 0
        for pid in self.processes():
            try:
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            total += sum(map(int, fields[11:15]))
        return total / TICKS


def service(checkout: Checkout) -> dict[str, float]:
    """Measure a new service: uploads, jobs, then its cost at rest."""
    with tempfile.TemporaryDirectory(dir=checkout.folder, ignore_cleanup_errors=True) as folder:
        running = Service(checkout, Path(folder))
        try:
            return measure_service(running, checkout.folder)
        finally:
            running.close()


def measure_service(running: Service, records: Path) -> dict[str, float]:
    timed = {}

    def clock(name: str, done: Callable[[], Any]) -> Any:
        began = time.perf_counter()
        answer = done()
        timed[name] = time.perf_counter() - began
        return answer

    running.run_job(running.upload(records / "process500.csv"), **SMALLEST)
    path = records / "process2000.csv"
    data = clock(f"upload of {path.stat().st_size // 1000} kB, s", lambda: running.upload(path))
    clock("smallest job, s", lambda: running.run_job(data, **SMALLEST))
    clock("default job, 2000 samples, s", lambda: running.run_job(data))
    time.sleep(SETTLING_SECONDS)
    timed["service at rest, MB"] = running.memory()
    before = running.processor_seconds()
    time.sleep(REST_SECONDS)
    timed["service at rest, % of a core"] = 100 * (running.processor_seconds() - before) / REST_SECONDS
    return timed


#: Search of the smallest job.
SMALLEST = {"preset": "narx", "seed": 1, "settings": {"islands": 1, "population": 20, "generations": 1}}

ROWS: Mapping[str, Row] = {
    "version": command("--version", "--version"),
    "fit-help": command("fit --help", "fit", "--help"),
    "jobs-help": command("jobs --help", "jobs", "--help"),
    "inspect": command("inspect, 500 samples", "inspect", "process500.csv"),
    "fit": command("fit, 500 samples", "fit", "process500.csv", *PAIR, out=True),
    "fit-long": command("fit, 100000 samples", "fit", "process100000.csv", *PAIR, out=True),
    "simulate": reads_fit("simulate, 500 samples", "simulate", "fitted", "process500.csv", out=True),
    "show": reads_fit("show", "show", "fitted"),
    "diagnose": command(
        "diagnose linear:1, 3000 samples",
        *("diagnose", "lag.csv", *PAIR, "--simulation", "linear:1"),
        out=True,
    ),
    "identify": command("identify, 3000 samples", "identify", "process3000.csv", *PAIR, out=True),
    "identify-long": command("identify, 20000 samples", "identify", "process20000.csv", *PAIR, out=True),
    "case1": command(
        "case 1, 500 x 500, two islands",
        *("identify", "piezo.csv", *PIEZO, "--preset", "paper-case1", "--seed", "1"),
        *("--set", "population=500", "--generations", "500", "--islands", "2"),
        out=True,
    ),
    "rate": rate(20_000),
    "rate-long": rate(100_000),
    "service": service,
}


@contextmanager
def prepare(paths: list[Path]) -> Iterator[list[Checkout]]:
    with ExitStack() as folders:
        yield [
            Checkout(
                path.resolve(),
                Path(folders.enter_context(tempfile.TemporaryDirectory(prefix="islands-times-"))),
            )
            for path in paths
        ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("rows", nargs="*", help=f"Some of: {', '.join(ROWS)}.")
    parser.add_argument("--checkout", type=Path, nargs="+", default=[Path(__file__).parents[2]])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    if unknown := set(given.rows) - set(ROWS):
        parser.error(f"there is no row {', '.join(sorted(unknown))}: take {', '.join(ROWS)}")
    found: dict[str, list[list[float]]] = {}
    with prepare(given.checkout) as checkouts:
        for name in given.rows or ROWS:
            times = measure(ROWS[name], checkouts, given.repeat)
            found |= times
            for row, values in times.items():
                print(format_row(row, values), flush=True)
    load = os.getloadavg()
    print(f"load of the machine at the end: {load[0]:.1f}, {load[1]:.1f}, {load[2]:.1f}")
    if given.json:
        names = [str(path) for path in given.checkout]
        given.json.write_text(json.dumps({"checkouts": names, "load": load, "rows": found}, indent=2))


def measure(row: Row, checkouts: list[Checkout], repeat: int) -> dict[str, list[list[float]]]:
    """Return the figures of a row: for each name and checkout, one value for each repetition."""
    for checkout in checkouts:
        row(checkout)  # compiles the kernels and the bytecode that it uses
    found: dict[str, list[list[float]]] = {}
    for _ in range(repeat):
        for index, checkout in enumerate(checkouts):
            for name, value in row(checkout).items():
                found.setdefault(name, [[] for _ in checkouts])[index].append(value)
    return found


def format_row(name: str, values: list[list[float]]) -> str:
    medians = [statistics.median(each) for each in values]
    columns = [
        f"{median:8.3g} ({min(each):.3g} to {max(each):.3g})"
        + ("" if index == 0 else f" x{median / medians[0]:.2f}")
        for index, (median, each) in enumerate(zip(medians, values, strict=True))
    ]
    return f"{name:36s} " + "  ".join(columns)


if __name__ == "__main__":
    sys.exit(main())
