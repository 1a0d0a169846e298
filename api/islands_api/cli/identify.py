"""``islands identify``: evolution by MGGP/FROE, refinement, validation."""

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from time import monotonic, perf_counter
from typing import Annotated, Any

import typer

import islands
from islands.errors import RecordError, SettingsError
from islands.estimation.constraints import CONSTRAINTS
from islands.evolution.presets import PRESETS
from islands.evolution.settings import Settings
from islands.identify import State
from islands.io.checkpoints import read_checkpoint, write_checkpoint
from islands.io.records import fingerprint, read_record
from islands.model.primitives import PRIMITIVES
from islands.validation.findings import Progress
from islands.validation.metrics import metrics
from islands_api.cli import options
from islands_api.cli.console import errors, output, progress
from islands_api.cli.fit import check_folder, show_result

CHECKPOINT = "checkpoint.json"

#: Seconds between two checkpoints: what a crash may cost.
CHECKPOINT_EVERY = 10.0

SETTINGS = ("population", "generations", "max_terms", "max_height", "shooting", "primitives", "constraints")


def identify(
    record: Annotated[Path | None, typer.Argument(help="The record: CSV or NPZ. Not with --resume.")] = None,
    inputs: Annotated[list[str] | None, typer.Option("--input", help="Input column; repeatable.")] = None,
    output_column: Annotated[str | None, typer.Option("--output", help="Output column.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder for the result.")] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    validation: Annotated[
        str | None,
        typer.Option("--validation", help="FILE, FRACTION of the end (default 0.25), or START:STOP."),
    ] = None,
    test: Annotated[
        str | None,
        typer.Option("--test", help="FILE, FRACTION of the end, or START:STOP: nothing touches it."),
    ] = None,
    preset: Annotated[str, typer.Option("--preset", help=", ".join(PRESETS))] = "hysteresis",
    population: Annotated[int | None, typer.Option("--population")] = None,
    generations: Annotated[int | None, typer.Option("--generations")] = None,
    max_terms: Annotated[int | None, typer.Option("--max-terms")] = None,
    max_height: Annotated[int | None, typer.Option("--max-height")] = None,
    shooting: Annotated[int | None, typer.Option("--shooting", help="Samples of an interval.")] = None,
    primitives: Annotated[
        list[str] | None, typer.Option("--primitive", help=f"Repeat it: {', '.join(PRIMITIVES)}.")
    ] = None,
    constraints: Annotated[str | None, typer.Option("--constraints", help=" or ".join(CONSTRAINTS))] = None,
    seed: Annotated[int, typer.Option("--seed", min=0)] = 0,
    force: Annotated[bool, typer.Option("--force", help="Replace a result that is in the folder.")] = False,
    resume: Annotated[Path | None, typer.Option("--resume", help="Folder of a run to go on with.")] = None,
) -> None:
    """Identify a record by evolution. Ctrl-C keeps the best so far; --resume DIR goes on."""
    if resume is not None:
        state, job = _stored(resume)
        folder = resume
    else:
        if record is None or not inputs or output_column is None or out is None:
            raise SettingsError("give RECORD, --input, --output and --out, or --resume DIR")
        check_folder(out, force)
        given = (population, generations, max_terms, max_height, shooting, primitives, constraints)
        changes = {name: value for name, value in zip(SETTINGS, given, strict=True) if value is not None}
        job = {
            "record": str(record.resolve()),
            "sha256": fingerprint(record),
            "inputs": options.columns(inputs),
            "output": output_column,
            "dt": dt,
            "rows": rows,
            "validation": validation,
            "test": test,
            "preset": preset,
            "seed": seed,
            "changes": changes,
        }
        state, folder = None, out
    _run(job, folder, state)


def _run(job: dict[str, Any], folder: Path, state: State | None) -> None:
    data, held_out, tested = _data(job)
    folder.mkdir(parents=True, exist_ok=True)
    began = perf_counter()
    with progress("identify") as tell, _stop_requests() as stop:
        arguments: dict[str, Any] = {
            "preset": job["preset"],
            "seed": job["seed"],
            "start": state,
            "progress": _Watch(folder, job, tell, stop),
            **job["changes"],
        }
        result = islands.identify(data, held_out, **arguments).with_wall_time(perf_counter() - began)
        tell("figures", 1.0)
        result.save(folder)
    if stop():
        errors.print(f"stopped: the result is the best so far; go on with --resume {folder}", markup=False)
    show_result(result, folder)
    if tested is not None:
        simulated = result.best.simulate(tested)
        found = metrics(tested.y, simulated.y)
        text = (
            f"test data, touched by nothing before: free run {simulated.outcome}, MAPE {found.mape:.4f} %, "
            f"R2 {found.r2:.5f}, RMSE {found.rmse:.6g}"
        )
        (folder / "test.json").write_text(json.dumps(asdict(found), indent=2) + "\n", encoding="utf-8")
        output.print(text, markup=False)


def _data(job: dict[str, Any]) -> tuple[islands.Dataset, islands.Dataset | float, islands.Dataset | None]:
    path = Path(job["record"])
    if fingerprint(path) != job["sha256"]:
        raise RecordError(f"{path} has changed since the run began: bring back the file, or start anew")
    columns = (job["inputs"], job["output"], job["dt"])
    data = read_record(path, *columns, options.rows(job["rows"]))
    tested = None
    if job["test"] is not None:
        held = options.validation(job["test"], path, *columns)
        if isinstance(held, float):
            parts = islands.split(data, held)
            data, tested = parts.estimation, parts.validation
        else:
            tested = held
    return data, options.validation(job["validation"], path, *columns), tested


class _Watch:
    """Shows where the search stands, writes checkpoints, and asks it to stop."""

    def __init__(
        self, folder: Path, job: dict[str, Any], tell: Callable[[str, float], None], stop: Callable[[], bool]
    ) -> None:
        self._folder, self._job, self._tell, self._stop = folder, job, tell, stop
        self._began = self._written = monotonic()
        self._first: int | None = None

    def __call__(self, state: State, settings: Settings) -> bool:
        now = monotonic()
        if self._first is None:
            self._first, self._began = state.evaluations, now
        rate = (state.evaluations - self._first) / max(now - self._began, 1e-9)
        done = state.archipelago.epoch / max(1, settings.generations)
        left = (settings.generations - state.archipelago.epoch) * settings.population / max(rate, 1e-9)
        best = " ".join(f"{size}:{error**0.5:.3g}" for size, error in state.history[-1].best.items())
        self._tell(
            f"generation {state.archipelago.epoch}/{settings.generations}, {rate:.0f}/s, "
            f"{left:.0f} s left, RMSE by terms {best}",
            done,
        )
        last = state.archipelago.epoch == settings.generations
        if self._stop() or last or now - self._written > CHECKPOINT_EVERY:
            self._written = now
            write_checkpoint(state.archipelago, self._folder / CHECKPOINT, _about(state, self._job))
        return self._stop()


@contextmanager
def _stop_requests() -> Iterator[Callable[[], bool]]:
    """Turn Ctrl-C and SIGTERM into a wish to stop; a second Ctrl-C interrupts at once."""
    wished = [False]

    def wish(number: int, _frame: object) -> None:
        if wished[0] and number == signal.SIGINT:
            raise KeyboardInterrupt
        wished[0] = True

    before = {number: signal.signal(number, wish) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: wished[0]
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _about(state: State, job: dict[str, Any]) -> dict[str, Any]:
    return {
        "job": job,
        "evaluations": state.evaluations,
        "duplicates": state.duplicates,
        "outcomes": dict(state.outcomes),
        "history": [[point.generation, point.evaluations, dict(point.best)] for point in state.history],
    }


def _stored(folder: Path) -> tuple[State, dict[str, Any]]:
    archipelago, about = read_checkpoint(folder / CHECKPOINT)
    history = tuple(
        Progress(generation, evaluations, {int(size): error for size, error in best.items()})
        for generation, evaluations, best in about["history"]
    )
    state = State(archipelago, about["evaluations"], about["duplicates"], about["outcomes"], history)
    return state, about["job"]
