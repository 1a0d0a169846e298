"""``islands demo``: the paper's case 1 from nothing, beside the paper's Table 1."""

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from rich.table import Table

import islands
from islands.io.records import write_record
from islands.simulation.predictors import free_run
from islands.systems.catalogue import make_record
from islands.systems.published_models import PUBLISHED
from islands.validation.metrics import metrics
from islands_api.cli.console import output, progress
from islands_api.cli.fit import check_folder, show_result

SYSTEM, VARIANT = "bouc-wen-piezo", "authors"


def demo(
    out: Annotated[Path, typer.Option("--out", help="Folder for the result.")] = Path("demo-out"),
) -> None:
    """Make the paper's case-1 record, fit it, and print the models beside the paper's Table 1."""
    check_folder(out, force=True)
    with progress("demo") as tell:
        tell("making the record", 0.0)
        estimation = make_record(SYSTEM, VARIANT, "estimation")
        validation = make_record(SYSTEM, VARIANT, "validation")
        out.mkdir(parents=True, exist_ok=True)
        write_record(estimation, out / "estimation.csv")
        write_record(validation, out / "validation.csv")
        began = perf_counter()
        result = islands.fit(estimation, validation, progress=tell).with_wall_time(perf_counter() - began)
        tell("figures", 1.0)
        result.save(out)
    show_result(result, out)

    table = Table(
        "model", "terms", "MAPE est. %", "MAPE val. %", "R2 est.", "R2 val.", title="Free run, 100 s"
    )
    for number in ("12", "13"):
        entry = PUBLISHED[number]
        errors = [metrics(record.y, free_run(entry.model, record).y) for record in (estimation, validation)]
        table.add_row(f"({number}), Table 1", str(entry.model.size), *_cells(*entry.mape, *entry.r2))
        table.add_row(
            f"({number}), its printed parameters",
            str(entry.model.size),
            *_cells(*(error.mape for error in errors), *(error.r2 for error in errors)),
        )
    for fitted in result.models[:3]:
        errors = [fitted.metrics[part]["free_run"] for part in ("estimation", "validation")]
        table.add_row(
            f"fitted here, rank {fitted.rank}",
            str(fitted.model.size),
            *_cells(*(error.mape for error in errors), *(error.r2 for error in errors)),
        )
    output.print(table)


def _cells(mape_estimation: float, mape_validation: float, *r2: float) -> list[str]:
    return [f"{mape_estimation:.4f}", f"{mape_validation:.4f}", *(f"{value:.5f}" for value in r2)]
