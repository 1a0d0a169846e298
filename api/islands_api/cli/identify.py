"""``islands identify``: evolution by MGGP/FROE, refinement, validation."""

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from time import monotonic, perf_counter
from typing import Annotated, Any

import typer

import islands
from islands.data.dataset import SAME_DT
from islands.errors import ModelError, RecordError, SettingsError
from islands.estimation.constraints import CONSTRAINTS
from islands.evolution.presets import PRESETS
from islands.evolution.settings import Settings
from islands.identify import State, settings_of
from islands.io.checkpoints import read_checkpoint, write_checkpoint
from islands.io.records import fingerprint, read_record
from islands.model.primitives import PRIMITIVES
from islands.validation.findings import Progress
from islands.validation.metrics import metrics
from islands_api.cli import options
from islands_api.cli.console import compile_kernels, errors, output, progress
from islands_api.cli.fit import check_folder, show_result

CHECKPOINT = "checkpoint.json"
TEST = "test.json"

#: Seconds between two checkpoints: what a crash may cost.
CHECKPOINT_EVERY = 10.0

SETTINGS = ("population", "generations", "max_terms", "max_height", "shooting", "primitives", "constraints")


def identify(
    context: typer.Context,
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
    verbose: Annotated[bool, typer.Option("--verbose", help="Tell what the caches take, too.")] = False,
) -> None:
    """Identify a record by evolution. Ctrl-C keeps the best so far; --resume DIR goes on."""
    if resume is not None:
        _refuse_others(context)
        _run(resume, *_stored(resume), verbose=verbose)
    else:
        if record is None or not inputs or output_column is None or out is None:
            raise SettingsError("give RECORD, --input, --output and --out, or --resume DIR")
        check_folder(out, force)
        given = (population, generations, max_terms, max_height, shooting, primitives, constraints)
        changes = {name: value for name, value in zip(SETTINGS, given, strict=True) if value is not None}
        sources = {"record": str(record), "validation": validation, "test": test}
        files = {
            kind: str(Path(name).resolve())
            for kind, name in sources.items()
            if name and (kind == "record" or Path(name).is_file())
        }
        job = {
            **sources,
            **files,
            "sha256": {path: fingerprint(path) for path in files.values()},
            "inputs": options.columns(inputs),
            "output": output_column,
            "dt": dt,
            "rows": rows,
            "preset": preset,
            "seed": seed,
            "changes": changes,
        }
        _run(out, job, verbose=verbose)


def _refuse_others(context: typer.Context) -> None:
    for name in context.params:
        source = context.get_parameter_source(name)
        if name not in ("resume", "verbose") and source is not None and source.name == "COMMANDLINE":
            raise SettingsError("--resume goes on with the run's own record and settings: give nothing else")


def _run(
    folder: Path,
    job: dict[str, Any],
    state: State | None = None,
    spent: float = 0.0,
    verbose: bool = False,
) -> None:
    settings = settings_of(job["preset"], job["changes"])
    data, held_out, tested = _data(job, settings)
    folder.mkdir(parents=True, exist_ok=True)
    if state is None:
        # What another run left here belongs to that run.
        for name in (CHECKPOINT, TEST):
            (folder / name).unlink(missing_ok=True)
    compile_kernels()
    began = perf_counter() - spent
    with progress("identify") as tell, _stop_requests() as stop:
        watch = _Watch(folder, job, tell, stop, spent)
        arguments: dict[str, Any] = {"preset": job["preset"], "seed": job["seed"], **job["changes"]}
        result = islands.identify(data, held_out, start=state, progress=watch, **arguments)
        result = result.with_wall_time(perf_counter() - began)
        tell("figures", 1.0)
        result.save(folder)
    if watch.stopped:
        errors.print(f"stopped: the result is the best so far; go on with --resume {folder}", markup=False)
    show_result(result, folder)
    if verbose:
        for name, (size, limit) in result.findings.search.caches.items():
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
    data = read_record(path, *columns, options.rows(job["rows"]))
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


def course(tell: Callable[[str, float], None]) -> Callable[[State, Settings], None]:
    """Return a watcher that shows where a search stands: generation, speed, time left, best by size."""
    began: list[tuple[float, int]] = []

    def watch(state: State, settings: Settings) -> None:
        now = monotonic()
        began[:] = began or [(now, state.evaluations)]
        rate = (state.evaluations - began[0][1]) / max(now - began[0][0], 1e-9)
        epoch, last = state.archipelago.epoch, settings.generations
        left = (last - epoch) * settings.population * len(state.archipelago.islands) / max(rate, 1e-9)
        best = " ".join(f"{size}:{error**0.5:.3g}" for size, error in state.history[-1].best.items())
        remaining = f"{left:.0f} s left, " if rate else ""
        tell(
            f"generation {epoch}/{last}, {rate:.0f}/s, {remaining}RMSE by terms {best}", epoch / max(1, last)
        )

    return watch


class _Watch:
    """Shows where the search stands, writes checkpoints, and asks it to stop."""

    def __init__(
        self,
        folder: Path,
        job: dict[str, Any],
        tell: Callable[[str, float], None],
        stop: Callable[[], bool],
        spent: float,
    ) -> None:
        self._path, self._job, self._stop = folder / CHECKPOINT, job, stop
        self._show = course(tell)
        self._written = monotonic()
        self._began = self._written - spent
        self.stopped = False

    def __call__(self, state: State, settings: Settings) -> bool:
        self._show(state, settings)
        last = state.archipelago.epoch == settings.generations
        self.stopped = self._stop() and not last
        if self.stopped or last or monotonic() - self._written > CHECKPOINT_EVERY:
            about = _about(state, self._job, monotonic() - self._began)
            write_checkpoint(state.archipelago, self._path, about)
            self._written = monotonic()
        return self.stopped


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


def _about(state: State, job: dict[str, Any], spent: float) -> dict[str, Any]:
    return {
        "job": job,
        "wall_s": spent,
        "evaluations": state.evaluations,
        "duplicates": state.duplicates,
        "outcomes": dict(state.outcomes),
        "history": [[point.generation, point.evaluations, dict(point.best)] for point in state.history],
    }


def _stored(folder: Path) -> tuple[dict[str, Any], State, float]:
    path = folder / CHECKPOINT
    archipelago, about = read_checkpoint(path)
    try:
        history = tuple(
            Progress(generation, evaluations, {int(size): error for size, error in best.items()})
            for generation, evaluations, best in about["history"]
        )
        state = State(archipelago, about["evaluations"], about["duplicates"], about["outcomes"], history)
        return dict(about["job"]), state, float(about["wall_s"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"{path} is no checkpoint of islands identify: {error!r}") from error
