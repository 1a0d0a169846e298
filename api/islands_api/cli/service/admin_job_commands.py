"""``islands admin jobs``: the jobs of all owners, in the database of a service."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Column, Table
from rich.text import Text

from islands.cli.console import output
from islands.errors import lookup
from islands_api.cli.service.store_options import COMMAND_LINE, Database, DataDir, open_store
from islands_service.domain.job import JobState


def jobs(
    cancel: Annotated[
        str | None,
        typer.Option("--cancel", metavar="JOB", help="Cancel this job; the audit trail records it."),
    ] = None,
    owner: Annotated[str | None, typer.Option("--owner", help="Only jobs of this owner.")] = None,
    state: Annotated[str | None, typer.Option("--state", help=", ".join(JobState))] = None,
    limit: Annotated[int, typer.Option("--limit", min=1, max=200, help="Largest number of jobs.")] = 50,
    data_dir: DataDir = None,
    database: Database = None,
) -> None:
    """List the jobs of all owners, newest first, or cancel one."""
    if cancel is not None:
        _cancel(cancel, data_dir, database)
        return
    wanted = None if state is None else lookup({str(each): each for each in JobState}, state, "state")
    with open_store(data_dir, database) as store:
        found = store.jobs.page(owner, wanted, None, limit).jobs
    table = Table(
        Column("job", no_wrap=True),
        *(Column(name, overflow="fold") for name in ("owner", "state", "run time / s")),
    )
    for job in found:
        # Names may contain characters that Rich takes for markup.
        table.add_row(job.id, Text(job.owner), str(job.state), f"{job.run_seconds:.0f}")
    output.print(table)


def _cancel(job: str, data_dir: Path | None, database: str | None) -> None:
    with open_store(data_dir, database) as store:
        cancelled = store.jobs.cancel(None, job, COMMAND_LINE)
    done = "is cancelled" if cancelled.state == JobState.CANCELLED else "is being cancelled"
    output.print(f"job {job} of owner {cancelled.owner} {done}", markup=False)
