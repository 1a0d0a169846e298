"""``islands benchmark``: errors of the searches on published sets, next to published errors."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from islands.benchmarks.catalogue import MEASURED, find_benchmark
from islands.benchmarks.definition import (
    CLASSES,
    Benchmark,
    PublishedError,
    list_missing_files,
    list_other_files,
    read_data,
)
from islands.benchmarks.public_package import list_package_sets
from islands.cli.console import output
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.stop_requests import stop_requests
from islands.distribution import read_version
from islands.errors import SettingsError, lookup
from islands.progress import report_part

if TYPE_CHECKING:
    from islands.benchmarks.comparison import BenchmarkRow

benchmark = typer.Typer(
    help="Published sets of measurements: list them, run the searches on them.",
    no_args_is_help=True,
    add_completion=False,
)

#: Name of all sets whose files are in the folder.
ALL = "all"

DataFolder = Annotated[
    Path | None,
    typer.Option("--data", envvar="ISLANDS_MEASURED_DIR", help="Folder with the files of the sets."),
]


@benchmark.command("list")
def list_benchmarks(data: DataFolder = None) -> None:
    """List the sets: tests with the least published errors, samples, where the data are, licence, rule."""
    for name, entry in MEASURED.items():
        output.print(Text("\n".join([name, *(f"  {line}" for line in _describe(entry, data))])))
    with progress("benchmark") as show:
        show("sets of the package", None)
        of_package = list_package_sets()
    if of_package:
        output.print(f"loaded by their package: {', '.join(of_package)}", markup=False)


@benchmark.command()
def run(
    names: Annotated[list[str], typer.Argument(help=f"Names from the list, or {ALL} that are present.")],
    classes: Annotated[
        list[str] | None,
        typer.Option("--model", help=f"Class of models; repeatable: {', '.join(CLASSES)}; by default all."),
    ] = None,
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, help="Searches of a class that depends on the seed, from 0 on.")
    ] = 1,
    budget: Annotated[
        float | None,
        typer.Option("--budget", help="Seconds after which a search ends with its best model so far."),
    ] = None,
    out: Annotated[Path | None, typer.Option("--json", help="JSON file for the results.")] = None,
    data: DataFolder = None,
) -> None:
    """Search models on the estimation data of sets, and measure them on their tests.

    Ctrl-C keeps the complete searches.
    """
    for each in classes or ():
        lookup(dict.fromkeys(CLASSES), each, "class of models")
    chosen = {name: find_benchmark(name) for name in _expand(names, data)}
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
    # Read first: an error in a file is shown before the searches, which take minutes.
    found = {}
    with progress("benchmark") as show:
        for name, entry in chosen.items():
            show(f"reading {name}", None)
            found[name] = read_data(name, entry, data)
    compile_kernels()
    # The searches load the kernels, which the help of the command does not need.
    from islands.benchmarks.comparison import ComparisonSettings, compare  # noqa: PLC0415

    settings = ComparisonSettings(tuple(classes or CLASSES), seeds, budget)
    rows: list[BenchmarkRow] = []
    incomplete: list[str] = []
    with progress("benchmark") as show, stop_requests() as stop:
        for place, (name, entry) in enumerate(chosen.items()):
            if not stop():
                part = report_part(show, place / len(chosen), (place + 1) / len(chosen))
                rows += compare(name, entry, found[name], settings, perf_counter, part, stop)
            incomplete += [name] * stop()
    for name in dict.fromkeys(row.benchmark for row in rows):
        _print_rows(name, [row for row in rows if row.benchmark == name])
    if out is not None:
        document = _make_document(chosen, data, settings.budget, rows)
        out.write_text(json.dumps(document, indent=1, allow_nan=False), encoding="utf-8")
    stop.end(out, incomplete, "repeat the command for all searches")


def _expand(names: Sequence[str], data: Path | None) -> list[str]:
    """Return the names, with those of all present sets in place of `ALL`."""
    if ALL not in names:
        return list(dict.fromkeys(names))
    present = [name for name, entry in MEASURED.items() if not list_missing_files(entry, data)]
    if not present:
        raise SettingsError(f"no set is present: give the folder of their files with --data; {data} has none")
    return list(dict.fromkeys([*present, *(name for name in names if name != ALL)]))


def _describe(entry: Benchmark, data: Path | None) -> list[str]:
    """Return the lines of the list about a set."""
    tests = (f"{test} (published: {_write_least(found)})" for test, found in entry.published.items())
    missing = list_missing_files(entry, data)
    files = (
        f"{file} is {'missing' if file in missing else 'present'} (SHA-256 {digest})"
        for file, digest in entry.files.items()
    )
    return [
        entry.description + " The searches were developed with this set at hand." * entry.is_tuned,
        f"tests in {entry.unit or 'the unit of the output'}: {', '.join(tests)}",
        f"{entry.samples} samples for the estimation; {entry.rule}",
        f"origin: {entry.address}; licence: {entry.licence}",
        *files,
    ]


def _write_least(published: Sequence[PublishedError]) -> str:
    return f"{published[0].value:g}" if published else "-"


def _write(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _print_rows(name: str, rows: Sequence["BenchmarkRow"]) -> None:
    """Print the table of a set, and below it why rows have no error."""
    unit = rows[0].unit or "the unit of the output"
    title = f"{name}, {rows[0].metric} in {unit}"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for column in ("test", "model"):
        table.add_column(column, no_wrap=True)
    for column in ("median", "worst", "claimed", "coverage", "published", "terms", "parameters", "s"):
        table.add_column(column, justify="right", no_wrap=True)
    reasons: dict[str, None] = {}
    for row in rows:
        least = _write_least(row.published)
        sizes = ("-" if each is None else f"{each:g}" for each in (row.terms, row.parameters))
        errors = (_write(each) for each in (row.median, row.worst, row.claimed, row.coverage))
        cells = (row.test, row.model, *errors, least, *sizes)
        table.add_row(*map(Text, (*cells, f"{row.wall_s:.0f}")))
        for each in row.per_seed:
            if each.reason is not None:
                reasons[f"{row.test}, {row.model}, seed {each.seed}: {each.reason}"] = None
    output.print(table)
    for reason in reasons:
        output.print(reason, markup=False)


def _make_document(
    chosen: Mapping[str, Benchmark], data: Path | None, budget: float | None, rows: Sequence["BenchmarkRow"]
) -> dict[str, Any]:
    """Return the rows, and the rules and options of the comparison, as JSON values."""
    return {
        "islands": read_version(),
        "budget_s": budget,
        "benchmarks": {
            name: {
                "description": entry.description,
                "rule": entry.rule,
                "address": entry.address,
                "licence": entry.licence,
                "is_tuned": entry.is_tuned,
                "other_files": list_other_files(entry, data or Path()),
            }
            for name, entry in chosen.items()
        },
        "results": [asdict(row) for row in rows],
    }
