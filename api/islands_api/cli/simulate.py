"""``islands simulate``: predict a record with a model."""

from pathlib import Path
from typing import Annotated

import typer

from islands.errors import ModelError
from islands.fitting import SHOOTING
from islands.io.records import read_record, write_simulation
from islands.result import simulate as run
from islands.validation.metrics import metrics
from islands_api.cli import options
from islands_api.cli.console import compile_kernels, output
from islands_service.rows import rows_of


def simulate(
    model: Annotated[str, typer.Argument(help="A model file, or published:12, published:13, published:14.")],
    record: options.Record,
    mode: Annotated[str, typer.Option("--mode", help="one-step, shooting or free-run.")] = "free-run",
    out: Annotated[Path | None, typer.Option("--out", help="CSV file for time and y_sim.")] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option("--input", help="Input column; by default what the model was fitted to."),
    ] = None,
    output_column: Annotated[str | None, typer.Option("--output", help="Output column; likewise.")] = None,
    dt: options.SamplingTime = None,
    rows: options.Rows = None,
    shooting: Annotated[int, typer.Option("--shooting", help="Samples of an interval.")] = SHOOTING,
) -> None:
    """Simulate a model on a record; a free run needs the output in its first samples alone."""
    chosen = options.model(model)
    data = read_record(
        record,
        options.columns(inputs or list(chosen.input_names)),
        output_column or chosen.output_name,
        dt,
        rows_of(rows),
        missing_output=True,
    )
    if chosen.dt is not None and abs(data.dt - chosen.dt) > 0.01 * chosen.dt:
        raise ModelError(
            f"the model holds for a sampling time of {chosen.dt:g} s, the record has {data.dt:g} s"
        )
    compile_kernels()
    simulation = run(chosen, data, mode, shooting)
    if out is not None:
        write_simulation(data, simulation.y, out)
        output.print(f"{out}: {data.samples} rows", markup=False)
    errors = metrics(data.y, simulation.y)
    output.print(f"{mode}: {simulation.outcome}", markup=False)
    output.print(
        f"MAPE {errors.mape:.4f} %  R2 {errors.r2:.5f}  RMSE {errors.rmse:.6g} {data.output_unit}  "
        f"fit {errors.fit_percent:.3f} %",
        markup=False,
    )
