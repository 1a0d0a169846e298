"""Shares of the phases of identifications and diagnoses, for the progress bar and the time left.

    python -m lab.searches.phase_shares [RUN ...] [--out FOLDER]

A run is recorded: the messages of its phases, the ends of its epochs and of its parallel maps, each with its
seconds. The table shows the seconds, the share and the steps of each phase, as in
`islands.diagnosis.procedure.PHASES` and `islands.facade.identification_progress`. With ``--out`` the
recordings are written, which tests replay. The seconds are those of one processor, which are the same on a
busy machine.
"""

import argparse
import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from islands.diagnosis.procedure import PHASES, diagnose
from islands.evolution.presets import AUTO, resolve_coupled_settings, resolve_kinds, resolve_settings
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.explain_residual import FORMULA, explain_residual
from islands.facade.identification_progress import identification_phases
from islands.facade.identify import identify
from islands.facade.results.complete_diagnosis import DiagnosisResult
from islands.facade.warm_up import warm_up
from islands.progress import Phase, never_stop
from islands.records.coupled import couple
from islands.records.dataset import Dataset
from islands.report.pages.origin import Origin
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import parse_spec

#: Names of rows that are no messages.
EPOCH, MAP = "epoch", "map"


class Recording:
    """Rows of a run: seconds, message, and fraction, generation or None."""

    def __init__(self, **about: Any) -> None:
        self.document = {**about, "rows": []}
        self._began = process_time()
        self._message = ""

    def __call__(self, message: str, fraction: float | None = None, /) -> None:
        if message != self._message or fraction is None:
            self.add(message, fraction)
        self._message = message

    def add(self, name: str, value: float | None = None) -> None:
        self.document["rows"].append([round(process_time() - self._began, 3), name, value])

    def epoch(self, state: Any, _settings: Any) -> None:
        self.add(EPOCH, state.history[-1].generation)

    def map(self, function: Callable[[Any], Any], arguments: Iterable[Any], /) -> Iterator[Any]:
        yield from map(function, arguments)
        self.add(MAP)


def make_process(samples: int) -> Dataset:
    """Return a record of a process of second order with a squared input."""
    rng = np.random.default_rng(1)
    u = np.repeat(rng.uniform(-1, 1, samples // 10), 10)
    y = np.zeros(samples)
    for k in range(2, samples):
        y[k] = 1.2 * y[k - 1] - 0.4 * y[k - 2] + 0.2 * u[k - 1] + 0.1 * u[k - 1] ** 2
    return Dataset(u[:, None], y + rng.normal(0, 0.005, samples), 0.01, ("u",), "y")


def make_saturating_process(samples: int) -> Dataset:
    """Return a record of a process of second order whose input saturates."""
    rng = np.random.default_rng(2)
    u = np.repeat(rng.uniform(-1, 1, samples // 15), 15)
    y, v = np.zeros(samples), np.tanh(1.5 * u)
    for k in range(2, samples):
        y[k] = 1.6 * y[k - 1] - 0.68 * y[k - 2] + 0.08 * v[k - 1]
    return Dataset(u[:, None], y + 0.05 + rng.normal(0, 0.003, samples), 0.01, ("u",), "y")


def make_stiff_oscillator(samples: int) -> Dataset:
    """Return a record of an oscillator whose spring stiffens with the cube of its travel."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.uniform(-1, 1, samples // 15), 15)
    y, state, dt, fine = np.zeros(samples), np.zeros(2), 0.01, 10
    for k in range(samples):
        y[k] = state[0]
        for _ in range(fine):
            x, v = state
            state = state + dt / fine * np.array([v, 80 * u[k] - 3 * v - 60 * x - 60 * x**3])
    return Dataset(u[:, None], y + rng.normal(0, 0.005, samples), dt, ("u",), "y")


def make_limited_process(samples: int) -> Dataset:
    """Return a record of two processes in series, of which the first one has limits."""
    rng = np.random.default_rng(4)
    u = np.repeat(rng.uniform(-2, 2, samples // 30), 30)
    y, inner, dt, fine = np.zeros(samples), 0.0, 0.1, 10
    for k in range(1, samples):
        y[k] = y[k - 1]
        for _ in range(fine):
            y[k] += dt / fine * (inner - y[k]) / 0.5
            inner = min(max(inner + dt / fine * (1.5 * u[k - 1] - inner) / 1.5, -1.8), 1.8)
    return Dataset(u[:, None], y + rng.normal(0, 0.01, samples), dt, ("u",), "y")


def run_identification(samples: int, preset: str = AUTO, **changes: Any) -> Recording:
    record = make_process(samples)
    settings = (
        next(iter(resolve_kinds(changes).values())) if preset == AUTO else resolve_settings(preset, changes)
    )
    sizes = {name: getattr(settings, name) for name in ("population", "islands", "generations")}
    recording = Recording(kind="identification", preset=preset, samples=samples, **sizes)
    chosen: Any = preset
    if preset == AUTO:
        chosen = choose_preset(record, 0.25, changes, recording, never_stop)
    identify(record, preset=chosen, seed=1, progress=recording, on_epoch=recording.epoch, **changes)
    recording.add("end")
    return recording


def run_outputs(samples: int) -> Recording:
    rng = np.random.default_rng(0)
    u = np.repeat(rng.uniform(-1, 1, samples // 10), 10)
    states = np.zeros((samples, 2))
    for k in range(1, samples):
        first, second = states[k - 1]
        states[k, 0] = 0.8 * first + 0.2 * u[k - 1] + 0.1 * second
        states[k, 1] = 0.7 * second + 0.2 * states[k, 0]
    y = states + rng.normal(0, 0.003, states.shape)
    whole = Dataset(np.column_stack([u, y[:, 1]]), y[:, 0], 0.01, ("u", "b"), "a")
    settings = resolve_coupled_settings(AUTO, {})
    sizes = {name: getattr(settings, name) for name in ("population", "islands", "generations")}
    recording = Recording(kind="outputs", outputs=["a", "b"], preset=AUTO, samples=samples, **sizes)
    identify(couple(whole, 2), seed=1, progress=recording, on_epoch=recording.epoch)
    recording.add("end")
    return recording


def run_diagnosis(record: Dataset, simulation: str) -> Recording:
    simulator = make_simulator(parse_spec(simulation), record)
    recording = Recording(kind="diagnosis", simulation=simulation, samples=record.samples)
    found = diagnose(record, simulator, {}, 0, recording, recording.map)
    recording(FORMULA)
    formula = explain_residual(found, 0, on_epoch=recording.epoch)
    recording("report")
    DiagnosisResult.from_diagnosis(found, formula).write_report(Origin("record"))
    recording.add("end")
    return recording


RUNS: dict[str, Callable[[], Recording]] = {
    "identification-500": lambda: run_identification(500),
    "identification-2000": lambda: run_identification(2000),
    "identification-20000": lambda: run_identification(20_000),
    "identification-narx": lambda: run_identification(3000, "narx", generations=400),
    "outputs": lambda: run_outputs(1500),
    "diagnosis-linear": lambda: run_diagnosis(make_process(3000), "linear:1"),
    "diagnosis-second-order": lambda: run_diagnosis(make_saturating_process(1500), "second-order"),
    "diagnosis-short": lambda: run_diagnosis(make_process(500), "second-order"),
    "diagnosis-known": lambda: run_diagnosis(make_stiff_oscillator(3000), "second-order"),
    "diagnosis-inside": lambda: run_diagnosis(make_limited_process(1500), "linear:2"),
    "diagnosis-explained": lambda: run_diagnosis(make_saturating_process(1500), "linear:2"),
}


def list_phases(document: dict[str, Any]) -> tuple[Phase, ...]:
    """Return the phases of a recorded run."""
    if document["kind"] == "diagnosis":
        return (*PHASES, Phase(FORMULA, 0.0), Phase("report", 0.0))
    preset = "narx" if document["preset"] == AUTO else document["preset"]
    sizes = {name: document[name] for name in ("population", "islands", "generations")}
    settings = resolve_settings(preset, sizes)
    outputs = document.get("outputs", ())
    return identification_phases(document["preset"], document["samples"], settings, outputs)


def before_colon(message: str) -> str:
    return message.partition(": ")[0]


def measure_phases(document: dict[str, Any]) -> list[tuple[str, float, int]]:
    """Return the seconds and the steps of each phase of a recorded run."""
    phases = list_phases(document)
    found = [[each.beginning, 0.0, 0] for each in phases]
    present, output, before = 0, "", document["rows"][0][0]
    for seconds, name, _ in document["rows"]:
        found[present][1] += seconds - before
        before = seconds
        output = f"{prefix}: " if (prefix := before_colon(name)) in document.get("outputs", ()) else output
        is_search = name == EPOCH and document["kind"] != "diagnosis"
        message = f"{output}search" if is_search else name
        following = range(present, len(phases))
        begun = next((at for at in following if message.startswith(phases[at].beginning)), present)
        found[begun][2] += begun == present and (name == MAP or message.startswith(phases[begun].beginning))
        present = begun
    return [(str(name), float(seconds), int(steps)) for name, seconds, steps in found]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("runs", nargs="*", help=f"Some of: {', '.join(RUNS)}.")
    parser.add_argument("--out", type=Path, help="Folder for the recordings.")
    given = parser.parse_args()
    warm_up(lambda _: None)
    for name in given.runs or RUNS:
        document = RUNS[name]().document
        if given.out:
            given.out.mkdir(parents=True, exist_ok=True)
            rows = ",\n".join(json.dumps(row) for row in document.pop("rows"))
            head = json.dumps(document)[:-1]
            (given.out / f"{name}.json").write_text(f'{head}, "rows": [\n{rows}\n]}}\n')
            document = json.loads((given.out / f"{name}.json").read_text())
        whole = document["rows"][-1][0] - document["rows"][0][0]
        print(f"{name}: {whole:.1f} s")
        for phase, seconds, steps in measure_phases(document):
            print(f"  {phase:48s} {seconds:7.2f} s {100 * seconds / whole:5.1f} % {steps:4d} steps")


if __name__ == "__main__":
    main()
