"""A run of ``islands identify`` in its folder: record, search, checkpoints, result."""

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from math import inf, isfinite
from pathlib import Path
from time import monotonic, perf_counter
from typing import Any

import islands
from islands.data.dataset import SAME_DT
from islands.errors import ModelError, RecordError, SettingsError
from islands.evolution.presets import resolve_settings
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.io.checkpoints import (
    read_checkpoint,
    state_document,
    state_from_document,
    write_checkpoint,
    write_hall,
)
from islands.io.records import fingerprint, read_record
from islands.io.records.row_range import parse_rows
from islands.validation.metrics import metrics
from islands_api.cli import options
from islands_api.cli.console import Display, compile_kernels, errors, output, print_message, progress
from islands_api.cli.output_folder import show_result
from islands_api.cli.search_progress import search_progress
from islands_service.engines import ENGINES

CHECKPOINT = "checkpoint.json"
HALL = "hall.json"
TEST = "test.json"

#: Seconds between two checkpoints: what a crash may cost.
CHECKPOINT_EVERY = 10.0

#: Part of a run that may go into checkpoints: of a thousand islands one takes half a minute.
CHECKPOINT_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How to run: nothing of it changes what is found, but for an end by the clock."""

    engine: str | None
    address: str | None
    wall_time: float | None
    verbose: bool

    def engine_for(self, islands: int) -> str:
        """Return the engine's name: Ray takes three seconds to start, and a single island gains nothing."""
        return self.engine or ("ray" if islands > 1 or self.address else "serial")


def run(
    manner: RunOptions,
    folder: Path,
    job: dict[str, Any],
    state: SearchState | None = None,
    spent: float = 0.0,
) -> None:
    """Run a job in a folder, or go on with it from a state that took some seconds; print what was found."""
    settings = resolve_settings(job["preset"], job["changes"])
    data, held_out, tested = _data(job, settings)
    folder.mkdir(parents=True, exist_ok=True)
    compile_kernels()
    carry_out = ENGINES[manner.engine_for(settings.islands)]
    with (
        progress("identify") as tell,
        # Ray takes over SIGTERM when it starts: it comes before our own handlers.
        carry_out(manner.address, print_message) as engine,
        _stop_requests(manner.wall_time) as stop,
    ):
        if state is None:
            # What another run left here belongs to that run.
            for name in (CHECKPOINT, HALL, TEST):
                (folder / name).unlink(missing_ok=True)
        watch = _Watch(folder, job, tell, state, spent)
        arguments: dict[str, Any] = {"preset": job["preset"], "seed": job["seed"], **job["changes"]}
        began = perf_counter() - spent
        try:
            result = islands.identify(
                data, held_out, start=state, progress=watch, stop=stop, engine=engine, **arguments
            )
        finally:
            # Also where the engine failed: no finished epoch is lost.
            watch.write()
        result = result.with_wall_time(perf_counter() - began)
        tell("figures", 1.0)
        result.save(folder)
    if result.search_result.search.ended_by == "stopped":
        errors.print(f"stopped: the result is the best so far; go on with --resume {folder}", markup=False)
        if manner.wall_time is not None:
            errors.print("an end by --wall-time is not reproducible: how far a search gets by then differs")
    show_result(result, folder)
    if manner.verbose:
        for name, (size, limit) in result.search_result.search.caches.items():
            output.print(f"cache of {name}: {size / 1e6:.1f} of {limit / 1e6:.1f} MB", markup=False)
    if tested is not None:
        _test(result, tested, folder)


def _test(result: islands.Result, tested: islands.Dataset, folder: Path) -> None:
    simulated = result.best.simulate(tested)
    found = asdict(metrics(tested.y, simulated.y)) if simulated.outcome else {}
    numbers = {name: value if isfinite(value) else None for name, value in found.items()}
    document = {"outcome": str(simulated.outcome), **numbers}
    (folder / TEST).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    text = f"test data, touched by nothing before: free run {simulated.outcome}"
    if found:
        text += f", MAPE {found['mape']:.4f} %, R2 {found['r2']:.5f}, RMSE {found['rmse']:.6g}"
    output.print(text, markup=False)


def _data(
    job: dict[str, Any], settings: Settings
) -> tuple[islands.Dataset, islands.Dataset | float, islands.Dataset | None]:
    for name, known in job["sha256"].items():
        if fingerprint(name) != known:
            raise RecordError(f"{name} has changed since the run began: bring back the file, or start anew")
    path = Path(job["record"])
    columns = (job["inputs"], job["output"], job["dt"])
    data = read_record(path, *columns, parse_rows(job["rows"]))
    held_out = options.validation(job["validation"], path, *columns, job["rows"])
    if job["test"] is None:
        return data, held_out, None
    tested = options.validation(job["test"], path, *columns, job["rows"], "--test")
    if isinstance(tested, float):
        parts = islands.split(data, tested)
        data, tested = parts.estimation, parts.validation
    _refuse_test(tested, [data] if isinstance(held_out, float) else [data, held_out], settings)
    return data, held_out, tested


def _refuse_test(tested: islands.Dataset, others: list[islands.Dataset], settings: Settings) -> None:
    for other in others:
        ahead = round((tested.start - other.start) / other.dt)
        if tested.sha256 == other.sha256 and -tested.samples < ahead < other.samples:
            raise SettingsError(
                "--test has samples that estimate or validate, and nothing may touch it: keep --rows and "
                "--validation off it"
            )
    dt, lag = others[0].dt, settings.maximum_lag
    if abs(tested.dt - dt) > SAME_DT * dt:
        raise RecordError(
            f"the test data was sampled at {tested.dt} s, the record at {dt} s: resample one of them"
        )
    if tested.samples <= lag:
        raise RecordError(
            f"the test data has {tested.samples} samples and lags reach down to {lag}: give more"
        )


class _Watch:
    """Shows where the search stands and writes checkpoints."""

    def __init__(
        self, folder: Path, job: dict[str, Any], tell: Display, state: SearchState | None, spent: float
    ) -> None:
        self._folder, self._job = folder, job
        self._show = search_progress(tell)
        self._next = -inf  # the first populations are kept at once
        self._began = monotonic() - spent
        self._state = state

    def __call__(self, state: SearchState, settings: Settings) -> None:
        self._state = state
        self._show(state, settings)
        if monotonic() > self._next:
            self.write()

    def write(self) -> None:
        """Write the last epoch, unless there is none."""
        if self._state is not None:
            now = monotonic()
            about = {"job": self._job, "wall_s": now - self._began, **state_document(self._state)}
            write_hall(self._state.archipelago.hall_of_fame, self._folder / HALL)
            write_checkpoint(self._state.archipelago, self._folder / CHECKPOINT, about)
            took = monotonic() - now
            self._next = now + took + max(CHECKPOINT_EVERY, took / CHECKPOINT_SHARE)


@contextmanager
def _stop_requests(wall_time: float | None) -> Iterator[Callable[[], bool]]:
    """Turn Ctrl-C, SIGTERM and the end of the time into a wish to stop; a second Ctrl-C interrupts."""
    wished = [False]
    until = inf if wall_time is None else monotonic() + wall_time

    def wish(number: int, _frame: object) -> None:
        if wished[0] and number == signal.SIGINT:
            raise KeyboardInterrupt
        wished[0] = True

    before = {number: signal.signal(number, wish) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: wished[0] or monotonic() > until
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def stored(folder: Path) -> tuple[dict[str, Any], SearchState, float]:
    """Read a folder's checkpoint: its job, where the search stands, and the seconds that it has taken.

    Raises
    ------
    ModelError
        There is none, or it is damaged.
    """
    path = folder / CHECKPOINT
    archipelago, about = read_checkpoint(path)
    try:
        return dict(about["job"]), state_from_document(archipelago, about), float(about["wall_s"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"{path} is no checkpoint of islands identify: {error!r}") from error
