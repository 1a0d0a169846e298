"""Hashes of results: run the same commands in two checkouts and compare their output files bit for bit.

    python -m lab.result_hashes CHECKOUT --out before.json
    python -m lab.result_hashes CHECKOUT --out after.json --against before.json

Every result comes from the command line or from the REST interface of the checkout, whose names are stable;
the Python names of the checkout are not used. Compare on one machine: another processor has another last bit.
"""

import argparse
import hashlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

Hashes = dict[str, str]

COLUMNS = ("--input", "u_V", "--output", "y_um")
SEARCH = ("--set", "population=40", "--generations", "40", "--islands", "3", "--seed", "3")
PROGRAM = """
import numpy as np

def simulate(u, dt, *, gain=0.8, pole=0.9):
    y = np.zeros(len(u))
    for k in range(1, len(u)):
        y[k] = pole * y[k - 1] + (1 - pole) * gain * u[k - 1]
    return y
"""

#: JSON keys whose values depend on the speed of the machine.
VOLATILE = frozenset({"wall_s", "evaluations_per_second"})


def write_table(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """Write columns as CSV with nine digits."""
    header = ",".join(columns)
    np.savetxt(path, np.column_stack(list(columns.values())), "%.9g", ",", header=header, comments="")
    return path


def make_records(folder: Path) -> None:
    """Write one record for each simulator: a plant with effects that the simulator lacks, and noise."""
    rng = np.random.default_rng(16)

    def sines(samples: int, dt: float, scale: float, frequencies: tuple[float, ...]) -> np.ndarray:
        time = dt * np.arange(samples)
        waves = sum(np.sin(2 * np.pi * f * time + 3 * f) for f in frequencies)
        return np.asarray(scale * waves / len(frequencies))

    # Oscillator with a cubic spring and dry friction; axis with an offset of force; by semi-implicit Euler.
    for name, stiffness, cubic, dry in (("oscillator", 400.0, 4e4, 0.2), ("axis", 0.0, 0.0, 0.5)):
        dt, fine = 2e-3, 10
        force = sines(4000, dt, 6.0, (0.7, 2.1, 3.3))
        x = v = 0.0
        y = np.zeros(force.size)
        for k in range(force.size):
            y[k] = x
            for _ in range(fine):
                v += (
                    dt
                    / fine
                    * (force[k] + 0.2 - 3 * v - stiffness * x - cubic * x**3 - dry * np.tanh(v / 0.01))
                )
                x += dt / fine * v
        y += 1e-4 * rng.standard_normal(y.size)
        write_table(folder / f"{name}.csv", {"t_s": dt * np.arange(y.size), "u_N": force, "y_m": y})
    # Two tanks, of which the lower one's sensor drifts.
    pump = 2.5 + sines(1500, 4.0, 2.0, (0.001, 0.0023, 0.0037))
    upper, lower, y = 5.0, 5.0, np.zeros(pump.size)
    for k in range(pump.size):
        y[k] = lower
        for _ in range(20):
            out, down = 0.05 * np.sqrt(max(lower, 0)), 0.05 * np.sqrt(max(upper, 0))
            upper, lower = upper + 0.2 * (0.04 * pump[k] - down), lower + 0.2 * (down - out)
    y += 2e-4 * np.arange(y.size) + 0.02 * rng.standard_normal(y.size)
    write_table(folder / "tanks.csv", {"t_s": 4.0 * np.arange(y.size), "u_V": pump, "y_V": y})
    # A lag of first order whose gain steps, next to a recorded simulation and two channels.
    u = sines(2500, 0.01, 3.0, (0.4, 1.1, 2.3))
    y = np.zeros(u.size)
    for k in range(1, u.size):
        y[k] = 0.9 * y[k - 1] + 0.08 * u[k - 1]
    simulated = y.copy()
    warmth = 20 + np.linspace(0, 3, u.size) + 0.1 * rng.standard_normal(u.size)
    y = y * np.where(np.arange(u.size) < 1200, 1.0, 1.15) + 0.03 * (warmth - 20)
    y += 0.01 * rng.standard_normal(u.size)
    write_table(
        folder / "lag.csv",
        {"t_s": 0.01 * np.arange(u.size), "u_V": u, "T_K": warmth, "theirs_um": simulated, "y_um": y},
    )
    (folder / "program.py").write_text(PROGRAM)


def strip_volatile(value: Any) -> Any:
    """Return a JSON value without times."""
    if isinstance(value, dict):
        return {key: strip_volatile(item) for key, item in value.items() if key not in VOLATILE}
    return [strip_volatile(item) for item in value] if isinstance(value, list) else value


def strip_prose(value: Any) -> Any:
    """Return an OpenAPI document without descriptions, which are free to change."""
    if isinstance(value, dict):
        prose = [key for key in ("description", "summary") if isinstance(value.get(key), str)]
        return {key: strip_prose(item) for key, item in value.items() if key not in prose}
    return [strip_prose(item) for item in value] if isinstance(value, list) else value


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:20]


def hash_file(path: Path) -> str:
    """Return the hash of a file; of JSON without what differs from run to run."""
    if path.suffix == ".json":
        return digest(json.dumps(strip_volatile(json.loads(path.read_text())), sort_keys=True).encode())
    return digest(path.read_bytes())


class Checkout:
    """The command line of a checkout, in a folder with records."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.python, self.islands = root / ".venv/bin/python", root / ".venv/bin/islands"
        self.folder = folder
        self.environment = {
            **os.environ,
            "COLUMNS": "100",
            "NO_COLOR": "1",
            "ISLANDS_DATA_DIR": str(folder / "data"),
        }

    def run(self, *arguments: object, check: bool = True) -> str:
        """Run a command; return its standard output."""
        done = subprocess.run(
            [self.islands, *map(str, arguments)],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if check and done.returncode:
            raise SystemExit(f"islands {' '.join(map(str, arguments))}\n{done.stderr}")
        return done.stdout

    def hash_outputs(self, out: str, *suffixes: str) -> Hashes:
        """Return the hashes of the files of a folder."""
        root = self.folder / out
        paths = sorted(path for path in root.rglob("*") if path.suffix in suffixes)
        return {f"{out}/{path.relative_to(root)}": hash_file(path) for path in paths}


def prepare(checkout: Checkout) -> None:
    """Make the records of simulated systems, and a model."""
    checkout.run("examples", "piezo.csv", "--system", "bouc-wen-piezo")
    checkout.run("examples", "s1.csv", "--system", "s1")
    checkout.run("fit", "piezo.csv", *COLUMNS, "--out", "fit")
    checkout.run("fit", "piezo.csv", *COLUMNS, "--max-terms", "2", "--out", "small")


def searches(checkout: Checkout) -> Iterator[Callable[[], Hashes]]:
    """Searches of three presets, serial and on Ray; a resumed search; a fit and its simulation."""
    s1 = (checkout.folder / "s1.csv").read_text().splitlines()[0].split(",")
    of_s1 = ("--input", s1[1], "--output", s1[-1])
    jobs = {
        "case1": ("piezo.csv", *COLUMNS, "--preset", "paper-case1"),
        "hysteresis": (
            "piezo.csv",
            *COLUMNS,
            *("--preset", "hysteresis", "--set", "topology=star"),
            *("--set", "characters=plain,explorer", "--set", "migrants=2", "--set", "emigrants=front"),
            *("--set", "replaced=random"),
        ),
        "narx": ("s1.csv", *of_s1, "--preset", "narx"),
    }
    models = (".json", ".svg", ".py", ".c", ".m")
    for name, job in jobs.items():
        for engine in ("serial", "ray"):
            out = f"{name}-{engine}"

            def search(job: tuple[str, ...] = job, out: str = out, engine: str = engine) -> Hashes:
                checkout.run("identify", *job, *SEARCH, "--engine", engine, "--out", out)
                found = checkout.hash_outputs(out, *models)
                return {
                    key: value
                    for key, value in found.items()
                    if not key.endswith(("checkpoint.json", "log.json"))
                }

            yield search

    def resumed() -> Hashes:
        job: list[str | Path] = [
            checkout.islands,
            "identify",
            *jobs["case1"],
            *SEARCH,
            "--engine",
            "serial",
            "--out",
            "resumed",
        ]
        running = subprocess.Popen(
            [*job, "--generations", "200"],
            cwd=checkout.folder,
            env=checkout.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        while running.poll() is None and not (checkout.folder / "resumed/checkpoint.json").exists():
            time.sleep(0.01)
        running.send_signal(signal.SIGINT)
        running.wait()
        checkout.run("identify", "--resume", "resumed")
        found = checkout.hash_outputs("resumed", ".json")
        return {key: value for key, value in found.items() if "/models/" in key or "hall" in key}

    def fitted() -> Hashes:
        checkout.run(
            "simulate", "fit/models/01.json", "piezo.csv", "--mode", "free-run", "--out", "free-run.csv"
        )
        return checkout.hash_outputs("fit", *models) | {
            "free-run.csv": hash_file(checkout.folder / "free-run.csv")
        }

    yield from (resumed, fitted)


def diagnoses(checkout: Checkout) -> Iterator[Callable[[], Hashes]]:
    """A diagnosis by every simulator, among them a model that a fit found, and a self-test."""
    lag = ("lag.csv", *COLUMNS, "--channel", "T_K", "--rows", "600:1800")
    jobs = {
        "bouc-wen-piezo": ("piezo.csv", *COLUMNS, "--tolerance", "A=0.02", "--rows", "0:1000"),
        "second-order": ("oscillator.csv", "--input", "u_N", "--output", "y_m", "--rows", "0:1000"),
        "rigid-axis": ("axis.csv", "--input", "u_N", "--output", "y_m", "--rows", "0:800"),
        "cascaded-tanks": ("tanks.csv", "--input", "u_V", "--output", "y_V", "--rows", "0:700"),
        "linear:1": lag,
        "column:theirs_um": lag,
        "python:program.py:simulate": lag,
        "model:small/models/01.json": ("piezo.csv", *COLUMNS, "--rows", "0:400"),
    }
    for simulation, job in jobs.items():
        name = f"diagnosis-{simulation.split(':')[0]}"

        def diagnose(job: tuple[str, ...] = job, simulation: str = simulation, name: str = name) -> Hashes:
            checkout.run("diagnose", *job, "--simulation", simulation, "--out", name)
            return checkout.hash_outputs(name, ".json", ".svg", ".py", ".c", ".m")

        yield diagnose

    def self_test() -> Hashes:
        checkout.run(
            "diagnose",
            *lag,
            *("--simulation", "column:theirs_um", "--self-test", "--workers", "2"),
            *("--out", "self-test"),
        )
        return checkout.hash_outputs("self-test", ".json")

    yield self_test


def trials(checkout: Checkout) -> Iterator[Callable[[], Hashes]]:
    """Blind trials of every simulator: each effect once, clean records, causes without a name."""
    for core in ("bouc-wen-piezo", "narx", "column", "second-order", "cascaded-tanks"):

        def run(core: str = core) -> Hashes:
            name = f"trials-{core}.json"
            checkout.run(
                *(
                    "trials",
                    *("--core", core, "--effects", "all", "--count", "1", "--clean", "2"),
                    *("--pairs", "1"),
                ),
                *("--open-set", "1", "--seed", "5", "--workers", "2", "--json", name),
                *(() if core == "cascaded-tanks" else ("--seconds", "10")),
                check=False,
            )
            return {name: hash_file(checkout.folder / name)}

        yield run


def interfaces(checkout: Checkout) -> Iterator[Callable[[], Hashes]]:
    """The OpenAPI document, and the help of every command."""

    def help_of_commands() -> Hashes:
        found = {"": digest(checkout.run("--help").encode())}
        commands = [
            ["identify"],
            ["fit"],
            ["diagnose"],
            ["simulate"],
            ["show"],
            ["demo"],
            ["bench"],
            ["trials"],
            ["examples"],
            ["serve"],
            ["jobs"],
            ["admin"],
        ]
        for group in ("jobs", "admin"):
            text = checkout.run(group, "--help")
            table = text[text.index("Commands") :]
            commands += [[group, name] for name in re.findall(r"^│ ([a-z-]+) ", table, re.MULTILINE)]
        for command in commands:
            # The text is compared, not the layout.
            text = " ".join(re.sub(r"[─-╿]", " ", checkout.run(*command, "--help")).split())
            found[" ".join(command)] = digest(text.encode())
        return {f"islands {name} --help": value for name, value in found.items()}

    def openapi() -> Hashes:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        server = subprocess.Popen(
            [checkout.islands, "serve", "--port", str(port), "--data-dir", checkout.folder / "service"],
            cwd=checkout.folder,
            env=checkout.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            for _ in range(300):
                try:
                    with urllib.request.urlopen(f"http://127.0.0.1:{port}/openapi.json") as answer:
                        document = json.loads(answer.read())
                    break
                except OSError:
                    time.sleep(0.2)
            else:
                raise SystemExit("the service did not start")
        finally:
            server.terminate()
            server.wait(60)
        document = strip_prose(document)
        paths = {
            f"openapi {path}": digest(json.dumps(value, sort_keys=True).encode())
            for path, value in document["paths"].items()
        }
        schemas = {
            f"openapi schema {name}": digest(json.dumps(value, sort_keys=True).encode())
            for name, value in document["components"]["schemas"].items()
        }
        return paths | schemas

    yield from (help_of_commands, openapi)


def import_seconds(checkout: Checkout) -> float:
    """Return the least time of five imports of the command line."""
    script = (
        "import time; t = time.perf_counter(); import islands_api.cli.app; print(time.perf_counter() - t)"
    )
    return min(
        float(
            subprocess.run([checkout.python, "-c", script], capture_output=True, text=True, check=True).stdout
        )
        for _ in range(5)
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkout", type=Path, help="folder with the sources and .venv")
    parser.add_argument("--out", type=Path, required=True, help="JSON file for the hashes")
    parser.add_argument("--against", type=Path, help="JSON file of another checkout")
    parser.add_argument("--only", default="", help="searches, diagnoses, trials or interfaces")
    asked = parser.parse_args()
    hashes: Hashes = {}
    with tempfile.TemporaryDirectory() as folder:
        make_records(Path(folder))
        checkout = Checkout(asked.checkout.resolve(), Path(folder))
        prepare(checkout)
        for group in (searches, diagnoses, trials, interfaces):
            if asked.only and group.__name__ not in asked.only.split(","):
                continue
            for job in group(checkout):
                began = time.perf_counter()
                found = job()
                hashes |= found
                asked.out.write_text(json.dumps(hashes, indent=1, sort_keys=True))
                print(
                    f"{time.perf_counter() - began:6.1f} s  {len(found):3} hashes  {next(iter(found))}",
                    flush=True,
                )
        print(f"import of the command line: {import_seconds(checkout):.3f} s")
    if asked.against:
        before = json.loads(asked.against.read_text())
        different = sorted(key for key in before.keys() | hashes.keys() if before.get(key) != hashes.get(key))
        print("\n".join(different) or f"all {len(hashes)} hashes are the same")
        sys.exit(bool(different))


if __name__ == "__main__":
    main()
