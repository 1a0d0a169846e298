"""``islands benchmark``: errors of the searches on published sets, next to published errors and to peers."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer
from platformdirs import user_cache_path
from rich.table import Table
from rich.text import Text

from islands.cli.console import output
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.stop_requests import stop_requests
from islands.distribution import read_version
from islands.errors import SettingsError, check_seconds, lookup
from islands.progress import prefix_messages, report_part
from lab.published_sets.catalogue import MEASURED, find_benchmark
from lab.published_sets.definition import (
    CLASSES,
    Benchmark,
    PublishedError,
    list_missing_files,
    list_other_files,
    read_data,
)
from lab.published_sets.peers.catalogue import PEERS
from lab.published_sets.public_package import list_package_sets

if TYPE_CHECKING:
    from lab.published_sets.comparison import BenchmarkRow
    from lab.published_sets.definition import BenchmarkData
    from lab.published_sets.peers.comparison import PeerRow

#: Name of all sets whose files are in the folder.
ALL = "all"


def benchmark(
    names: Annotated[
        list[str] | None,
        typer.Argument(help=f"Names of sets, or {ALL} that are present; without them, the sets are listed."),
    ] = None,
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
    peer: Annotated[
        list[str] | None,
        typer.Option(
            "--peer",
            help=f"Measure another package in place of the searches; repeatable: {', '.join(PEERS)}; {ALL}.",
        ),
    ] = None,
    environments: Annotated[
        Path | None,
        typer.Option(
            "--environments",
            help="Folder for the virtual environments of the packages; by default in the user's cache.",
        ),
    ] = None,
    limit: Annotated[float, typer.Option("--limit", help="CPU seconds of a package on a set.")] = 300.0,
    out: Annotated[Path | None, typer.Option("--json", help="JSON file for the results.")] = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", envvar="ISLANDS_MEASURED_DIR", help="Folder with the files of the sets."),
    ] = None,
) -> None:
    """List published sets, or measure searches or other packages on their tests.

    Each package is installed from the package index into its own virtual environment. Ctrl-C keeps the
    complete searches and runs.
    """
    if not names:
        _list(data)
    elif peer:
        _measure_peers(names, [*PEERS] if ALL in peer else peer, environments, limit, out, data)
    else:
        _measure_searches(names, classes or [*CLASSES], seeds, budget, out, data)


def _list(data: Path | None) -> None:
    for name, entry in MEASURED.items():
        output.print(Text("\n".join([name, *(f"  {line}" for line in _describe(entry, data))])))
    with progress("benchmark") as show:
        show("sets of the package", None)
        of_package = list_package_sets()
    if of_package:
        output.print(f"loaded by their package: {', '.join(of_package)}", markup=False)


def _measure_searches(
    names: Sequence[str],
    classes: Sequence[str],
    seeds: int,
    budget: float | None,
    out: Path | None,
    data: Path | None,
) -> None:
    for each in classes:
        lookup(dict.fromkeys(CLASSES), each, "class of models")
    chosen = {name: find_benchmark(name) for name in _expand(names, data)}
    found = _read(chosen, data, out)
    compile_kernels()
    # The searches load the kernels, which the help of the command does not need.
    from lab.published_sets.comparison import ComparisonSettings, compare

    settings = ComparisonSettings(tuple(classes), seeds, budget)
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
    _write_document(out, chosen, data, rows, budget_s=settings.budget)
    stop.end(out, incomplete, "repeat the command for all searches")


def _measure_peers(
    names: Sequence[str],
    peers: Sequence[str],
    environments: Path | None,
    limit: float,
    out: Path | None,
    data: Path | None,
) -> None:
    selected = {each: lookup(PEERS, each, "package") for each in peers}
    check_seconds(limit, "the limit")
    chosen = {name: find_benchmark(name) for name in _expand(names, data)}
    found = _read(chosen, data, out)
    # They load the simulation of models, which the help of the command does not need.
    from lab.published_sets.peers.comparison import compare_peer
    from lab.published_sets.peers.environments import prepare_environment

    folder = environments or user_cache_path("islands", appauthor=False) / "peers"
    runs = [(name, each) for name in chosen for each in selected]
    rows: list[PeerRow] = []
    incomplete: list[str] = []
    with progress("benchmark") as show, stop_requests() as stop:
        installed = {}
        for name, each in selected.items():
            show(f"installing {each.package} {each.version}", None)
            installed[name] = prepare_environment(each, folder, stop)
        for place, (name, package) in enumerate(runs):
            title = f"{name}, {package}"
            if not stop():
                part = report_part(show, place / len(runs), (place + 1) / len(runs))
                report = prefix_messages(part, f"{title}: ")
                python = installed[package].python
                rows += compare_peer(
                    name, chosen[name], found[name], selected[package], python, limit, report, stop
                )
            incomplete += [title] * stop()
    for name in dict.fromkeys(row.benchmark for row in rows):
        _print_peers(name, chosen[name], [row for row in rows if row.benchmark == name])
    for each in selected.values():
        output.print(f"{each.package} {each.version}: {each.setting}", markup=False)
    packages = {name: each.packages for name, each in installed.items()}
    _write_document(out, chosen, data, rows, limit_s=limit, packages=packages)
    stop.end(out, incomplete, "repeat the command for all runs")


def _read(chosen: Mapping[str, Benchmark], data: Path | None, out: Path | None) -> dict[str, "BenchmarkData"]:
    """Return the data of the sets, and make the folder of the results.

    An error in a file is shown before the searches, which take minutes.
    """
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
    found = {}
    with progress("benchmark") as show:
        for name, entry in chosen.items():
            show(f"reading {name}", None)
            found[name] = read_data(name, entry, data)
    return found


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


def _print_peers(name: str, entry: Benchmark, rows: Sequence["PeerRow"]) -> None:
    """Print the table of a set, and below it what was chosen, or why rows have no error."""
    title = f"{name}, {rows[0].metric} in {rows[0].unit or 'the unit of the output'}"
    table = Table(title=title, title_justify="left", box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for column in ("test", "package", "version"):
        table.add_column(column, no_wrap=True)
    for column in ("error", "published", "CPU s"):
        table.add_column(column, justify="right", no_wrap=True)
    remarks: dict[str, None] = {}
    tests = dict.fromkeys(row.test for row in rows)
    for row in (each for test in tests for each in rows if each.test == test):
        least = _write_least(entry.published.get(row.test, ()))
        cells = (row.test, row.peer, row.version, _write(row.error), least, f"{row.cpu_s:.0f}")
        table.add_row(*map(Text, cells))
        if row.reason is not None:
            remarks[f"{row.test}, {row.peer}: {row.reason}"] = None
        elif row.chosen is not None:
            remarks[f"{row.peer}: {row.chosen}"] = None
    output.print(table)
    for remark in remarks:
        output.print(remark, markup=False)


def _write_document(
    out: Path | None,
    chosen: Mapping[str, Benchmark],
    data: Path | None,
    rows: Sequence["BenchmarkRow"] | Sequence["PeerRow"],
    **options: Any,
) -> None:
    """Write the rows, and the rules and options of the comparison, to a file if one is given."""
    if out is None:
        return
    document = {
        "islands": read_version(),
        **options,
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
    out.write_text(json.dumps(document, indent=1, allow_nan=False), encoding="utf-8")
