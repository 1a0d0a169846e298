"""Run of ``islands identify`` in its folder: record, search, checkpoints, result."""

from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from math import inf
from pathlib import Path
from time import monotonic, perf_counter
from typing import Any, NamedTuple

import islands
from islands.cli.console import errors, output, print_message
from islands.cli.engines import ENGINES, TimedEngine, check_engine, start_engine
from islands.cli.output_folder import keep_models, print_failures, run_search, show_result
from islands.cli.progress_display import Display, compile_kernels, progress
from islands.cli.recordings import Recordings, state_extrapolation
from islands.cli.runs.held_out_test import TEST, evaluate_test
from islands.cli.search_progress import SearchDisplay
from islands.cli.stop_requests import REPEAT, StopRequests, stop_requests
from islands.errors import ModelError, RecordError, SettingsError
from islands.evolution.presets import (
    AUTO,
    resolve_coupled_settings,
    resolve_kinds,
    resolve_settings,
)
from islands.evolution.search_result import ResultCallback
from islands.evolution.search_state import SearchState
from islands.evolution.settings import Settings
from islands.facade.automatic.choice import Choice, choice_from_document
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.front import StoppedFitError
from islands.facade.identify import identify_record
from islands.persistence.checkpoints import (
    read_checkpoint,
    state_document,
    state_from_document,
    write_checkpoint,
    write_hall,
)
from islands.progress import ProgressCallback, Steps
from islands.records.compatibility import match_record
from islands.records.coupled import AnyRecord, split_first, split_record
from islands.records.preprocessing_steps import PreprocessingSteps
from islands.records.reading import fingerprint
from islands.records.reading.options import ReadingOptions
from islands.records.split import share_samples
from islands.settings_schema import setting, settings_class

#: File of the search state.
CHECKPOINT = "checkpoint.json"

#: File of the hall of fame.
HALL = "hall.json"

#: Least seconds between two checkpoints: the work that a crash may lose.
CHECKPOINT_SECONDS = 10.0

#: Largest fraction of the run time spent on checkpoints. One of a thousand islands takes half a minute.
CHECKPOINT_FRACTION = 0.05


@settings_class
class RunSettings:
    """Settings of a run. They do not change its result, except for `wall_time`."""

    engine: str | None = setting(
        None, "serial or ray; by default ray for several islands, if installed.", choices=ENGINES, daily=True
    )
    ray_address: str | None = setting(None, "HOST:PORT of a cluster; this machine by default.")
    wall_time: float | None = setting(
        None,
        "Stop after this time. Such a result is not reproducible: machines differ.",
        gt=0,
        unit="s",
        daily=True,
    )
    verbose: bool = setting(False, "Also print the memory used by the caches.")

    def __post_init__(self) -> None:
        if self.ray_address is not None and self.engine == "serial":
            raise SettingsError("ray_address requires --engine ray: the serial engine runs in this process")


class RunOptions(NamedTuple):
    """Settings of a run, and names of the figures to draw."""

    settings: RunSettings
    figures: tuple[str, ...]


def run(
    run_options: RunOptions,
    folder: Path,
    job: dict[str, Any],
    state: SearchState | None = None,
    spent: float = 0.0,
) -> None:
    """Run a job in a folder, or resume it, and print the result.

    Parameters
    ----------
    job : dict
        Recordings, columns, preset, seed and changed settings.
    state : SearchState, optional
        State from which the search is resumed.
    spent : float
        Seconds that the search took to reach this state.
    """
    possible = _resolve_possible(job)
    data, held_out, test_data = _read_data(job, max(each.maximum_lag for each in possible))
    settings = run_options.settings
    chosen = settings.engine, settings.ray_address
    check_engine(*chosen)
    folder.mkdir(parents=True, exist_ok=True)
    compile_kernels()
    with ExitStack() as handlers:
        with (
            progress("identify") as show,
            start_engine(*chosen, possible[0].islands, print_message) as started,
        ):
            # After the start of Ray, which installs a handler for SIGTERM, and until the command ends: a
            # signal that arrives while Ray ends does not discard the result.
            stop = handlers.enter_context(stop_requests())
            until = inf if settings.wall_time is None else monotonic() + settings.wall_time
            engine = TimedEngine(started, until, len(job["outputs"]))
            if state is None:
                # Delete the files of an earlier run.
                for name in (CHECKPOINT, HALL, TEST):
                    (folder / name).unlink(missing_ok=True)
            preset, keep = job["preset"], keep_models(folder, data.output_names, show)
            searching = _make_display(show, job, data, possible[0])
            if preset == AUTO and len(job["outputs"]) == 1:
                preset = _choose_preset(
                    data, held_out, job, searching, stop, keep, folder, run_options.figures
                )
                # Checkpoints contain the job, so a resumed run does not choose again.
                job = {**job, "choice": preset.to_checkpoint()}
            checkpoints = _CheckpointWriter(folder, job, searching, state, spent)
            began = perf_counter() - spent
            try:
                search = partial(
                    identify_record,
                    data,
                    held_out,
                    on_models=keep,
                    start=state,
                    progress=searching,
                    on_epoch=checkpoints,
                    stop=stop,
                    engine=engine,
                    preset=preset,
                    seed=job["seed"],
                    **job["changes"],
                )
                explain = partial(_explain_continuation, folder)
                result = run_search(search, folder, stop, run_options.figures, explain)
            finally:
                # Also after an engine failure, so that no finished epoch is lost.
                checkpoints.write()
            result = result.with_wall_time(perf_counter() - began)
            show("figures", 1.0)
            drawing = Steps(stop=stop)
            result.save(folder, drawing, run_options.figures)
        _show_run(result, run_options, folder, stop)
        if test_data is not None:
            steps = Steps()
            steps.attempt("errors on the test data", partial(evaluate_test, result, test_data, folder))
            print_failures(steps.not_computed)
        stop.end(folder, (*result.left_out, *drawing.left_out), _explain_continuation(folder))


def _explain_continuation(folder: Path) -> str:
    """Say how to get the complete result. A run has no checkpoint before its first epoch."""
    return f"continue with --resume {folder}" if (folder / CHECKPOINT).exists() else REPEAT


def _show_run(result: islands.Result, options: RunOptions, folder: Path, stop: StopRequests) -> None:
    """Print the result, whether its searches ended before their last generations, and their caches."""
    results = result.outputs or (result,)
    searches = [each.search_result.search for each in results]
    if not stop() and any(each.ended_by == "stopped" for each in searches):
        errors.print(f"stopped: the result is the best so far; continue with --resume {folder}", markup=False)
        if options.settings.wall_time is not None:
            errors.print(
                "a result limited by --wall-time is not reproducible: it depends on the speed of the run"
            )
    show_result(result, folder)
    if options.settings.verbose:
        for each in searches:
            for name, (size, limit) in each.caches.items():
                output.print(f"cache of {name}: {size / 1e6:.1f} of {limit / 1e6:.1f} MB", markup=False)


def _make_display(show: Display, job: dict[str, Any], data: AnyRecord, settings: Settings) -> SearchDisplay:
    preset = job.get("choice") or job["preset"]
    return SearchDisplay(show, preset, data.samples, settings, data.output_names)


def _choose_preset(
    data: Any,
    held_out: Any,
    job: dict[str, Any],
    progress: ProgressCallback,
    stop: StopRequests,
    keep: ResultCallback,
    folder: Path,
    figures: Sequence[str],
) -> Choice:
    """Return the stored choice of the preset, or choose one.

    If a stop is requested, save the models of the kinds that were fitted, and end.
    """
    if stored := job.get("choice"):
        return choice_from_document(stored)
    try:
        return choose_preset(data, held_out, job["changes"], progress, stop, keep)
    except StoppedFitError as stopped:
        result, drawing = islands.Result.from_search(stopped.found), Steps(stop=stop)
        result.save(folder, drawing, figures)
        show_result(result, folder)
        stop.end(folder, (*result.left_out, "the search", *drawing.left_out), REPEAT)
        raise


def _resolve_possible(job: dict[str, Any]) -> tuple[Settings, ...]:
    """Return the settings of a job, or of every kind of record among which the preset auto chooses."""
    if len(job["outputs"]) > 1:
        return (resolve_coupled_settings(job["preset"], job["changes"]),)
    if job["preset"] == AUTO:
        return tuple(resolve_kinds(job["changes"]).values())
    return (resolve_settings(job["preset"], job["changes"]),)


def _read_data(job: dict[str, Any], lag: int) -> tuple[AnyRecord, AnyRecord | float, AnyRecord | None]:
    """Read the data for estimation, validation (or its fraction) and the final test.

    Raises
    ------
    SettingsError, RecordError
        A file has changed, or a part shares samples with another one or is too short.
    """
    for name, known in job["sha256"].items():
        if fingerprint(name) != known:
            raise RecordError(f"{name} has changed since the run began: restore the file, or start a new run")
    reading = ReadingOptions(**job.get("reading", {}))
    steps = PreprocessingSteps(**job.get("preprocessing", {}))
    paths = [Path(name) for name in job["records"]]
    recordings = Recordings(paths, job["inputs"], job["outputs"], job["dt"], reading, steps)
    rows, test = job["rows"], job["test"]
    data = recordings.read(rows)
    held_out = recordings.read_held_out(job["validation"], rows)
    test_data: AnyRecord | None = None
    if test is not None:
        given = recordings.read_held_out(test, rows, "--test")
        if isinstance(given, float):
            data, test_data = split_record(data, given)
        else:
            test_data = given
        _check_test(test_data, [data] if isinstance(held_out, float) else [data, held_out], lag)
    # Check the validation data before the folder is made; the search repeats this.
    split_first(data, held_out)
    state_extrapolation(data, held_out)
    return data, held_out, test_data


def _check_test(test_data: AnyRecord, others: list[AnyRecord], lag: int) -> None:
    """Check that the test data overlaps no other data, has the same sampling time and is long enough."""
    used = [each.records[0] for each in others]
    tested = match_record(used[0], test_data.records[0], "the record", "the test data")
    for other in used:
        if share_samples(other, tested):
            raise SettingsError(
                "--test has samples that are used for estimation or validation: exclude them by --rows and "
                "--validation"
            )
    if test_data.samples <= lag:
        raise RecordError(
            f"the test data has {test_data.samples} samples, and the largest lag is {lag}: give more samples"
        )


class _CheckpointWriter:
    """Search callback that shows the progress and writes checkpoints."""

    def __init__(
        self,
        folder: Path,
        job: dict[str, Any],
        display: SearchDisplay,
        state: SearchState | None,
        spent: float,
    ) -> None:
        self._folder, self._job = folder, job
        self._display = display
        self._next = -inf  # the first populations are written immediately
        self._began = monotonic() - spent
        self._state = state

    def __call__(self, state: SearchState, settings: Settings) -> None:
        self._state = state
        self._display.show_epoch(state, settings)
        if monotonic() > self._next:
            self.write()

    def write(self) -> None:
        """Write a checkpoint of the last epoch, if an epoch has ended."""
        if self._state is not None:
            now = monotonic()
            header = {"job": self._job, "wall_s": now - self._began, **state_document(self._state)}
            write_hall(self._state.archipelago.hall_of_fame, self._folder / HALL)
            write_checkpoint(self._state.archipelago, self._folder / CHECKPOINT, header)
            took = monotonic() - now
            self._next = now + took + max(CHECKPOINT_SECONDS, took / CHECKPOINT_FRACTION)


def load_run(folder: Path) -> tuple[dict[str, Any], SearchState, float]:
    """Read the checkpoint of a folder: the job, the search state, and the seconds spent.

    Raises
    ------
    ModelError
        The checkpoint is missing or damaged.
    """
    path = folder / CHECKPOINT
    archipelago, header = read_checkpoint(path)
    try:
        return dict(header["job"]), state_from_document(archipelago, header), float(header["wall_s"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"{path} is not a checkpoint of islands identify: {error!r}") from error
