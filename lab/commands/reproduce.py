"""``islands reproduce``: the tables and figures of the paper, computed, next to the published numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from signal import SIGINT
from types import MappingProxyType
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from islands.cli.console import errors, output
from islands.cli.output_folder import check_folder
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.stop_requests import INTERRUPTED, TERMINATED, stop_requests
from islands.errors import SettingsError, lookup
from islands.progress import Steps, StoppedError
from lab.parallel_map import open_pool
from lab.reproduction import appendix_a, case1, case2
from lab.reproduction.page import write_reproduction
from lab.reproduction.section import ComparisonTable, Section
from lab.reproduction.tasks import Document, ReproductionOptions, Task, read_results, run_tasks


@dataclass(frozen=True, slots=True)
class PaperPart:
    """A part of the paper: the functions that plan its tasks and compare their results with the paper."""

    plan: Callable[[ReproductionOptions], list[Task]]
    summarise: Callable[[Mapping[str, Document], ReproductionOptions], Section]


#: Parts by name, in the order of the page.
PARTS: Mapping[str, PaperPart] = MappingProxyType(
    {
        "case1": PaperPart(case1.plan, case1.summarise),
        "case2": PaperPart(case2.plan, case2.summarise),
        "appendix-a": PaperPart(appendix_a.plan, appendix_a.summarise),
    }
)

#: Name of all parts.
ALL = "all"

#: Folder of the stored results, within the folder of the page.
TASKS = "tasks"


def reproduce(
    part: Annotated[str, typer.Argument(help=f"{', '.join(PARTS)} or {ALL}.")] = ALL,
    quick: Annotated[
        bool, typer.Option("--quick", help="Short searches, about a minute; the numbers are not the paper's.")
    ] = False,
    seeds: Annotated[
        int,
        typer.Option("--seeds", min=1, help="Searches of case 1 for each switch; at most 2 with --quick."),
    ] = 10,
    runs: Annotated[int, typer.Option("--runs", min=1, help="Monte Carlo runs of Appendix A.")] = 50,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data",
            help="Measured record of case 2 (h50us.csv: index, time, output, input); without it, a simulated "
            "one takes its place.",
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", help="Folder for the page.")] = Path("reproduction-out"),
) -> None:
    """Compute the tables and figures of the paper, and write them next to the published numbers.

    Ctrl-C keeps the finished searches; the same command continues.
    """
    chosen = PARTS if part == ALL else {part: lookup(PARTS, part, "part of the paper")}
    if data is not None and "case2" not in chosen:
        raise SettingsError(f"--data is the record of case2, which {part} does not contain")
    check_folder(out, force=True)
    # Absolute, because tasks run in other processes, whose folder may be another.
    options = ReproductionOptions(seeds, runs, quick, "" if data is None else str(data.absolute()))
    planned = {name: each.plan(options) for name, each in chosen.items()}
    tasks = [task for each in planned.values() for task in each]
    compile_kernels()
    results = _run(tasks, out.absolute() / TASKS)
    with progress("reproduce") as show:
        show("figures", None)
        sections = [
            PARTS[name].summarise({task.key: results[task.key] for task in each}, options)
            for name, each in planned.items()
        ]
        files = write_reproduction(sections, out)
    for section in sections:
        for compared in section.tables:
            output.print(_make_table(compared))
    page, numbers, figures = files
    output.print(f"{page} says why the numbers differ; {numbers} and {figures}/", markup=False)


def _run(tasks: list[Task], folder: Path) -> dict[str, Document]:
    """Run the tasks on all cores; after a stop request, say how to continue."""
    with progress("reproduce") as show, stop_requests() as stop:
        steps = Steps(show, stop)
        try:
            with open_pool(None, None, partial(steps.check, "the rest of the tasks")) as parallel_map:
                return run_tasks(tasks, folder, parallel_map, show)
        except StoppedError:
            pass
    stored = len(read_results(tasks, folder))
    errors.print(
        f"stopped: {folder} has the results of {stored} of {len(tasks)} tasks; repeat the command",
        markup=False,
    )
    raise typer.Exit(INTERRUPTED if stop.number == SIGINT else TERMINATED)


def _make_table(compared: ComparisonTable) -> Table:
    """Return a table for the terminal: without the sentences of the last column, which need a page."""
    first, *others = compared.columns[:-1]
    table = Table(first, title=compared.title, title_justify="left")
    for column in others:
        table.add_column(column, justify="right")
    for row in compared.rows:
        table.add_row(*(Text(cell) for cell in row[:-1]))
    return table
