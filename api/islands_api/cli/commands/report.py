"""``islands report``: the report of a result folder, of a job, or of a comparison, as one HTML file."""

import re
from pathlib import Path
from typing import Annotated

import typer

from islands.cli.console import output
from islands.errors import SettingsError
from islands.report.pages.origin import REPORT_FILE
from islands_api.cli.service.client_options import LOCAL, ApiKey, Url, open_client

#: Id of a job, and of a job with the rank of a model.
_JOB_ID = re.compile("[0-9a-f]{32}")
_MODEL = re.compile("([0-9a-f]{32})(?::([1-9][0-9]*))?")


def report(
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="DIR|JOB [JOB ...]",
            help="Folder of a result or of a diagnosis, or id of a job; two to six jobs are compared, by the "
            "recommended model or by the one of JOB:RANK.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="HTML file; by default report.html in the folder, report-JOB.html or comparison.html.",
        ),
    ] = None,
    url: Url = LOCAL,
    key: ApiKey = None,
) -> None:
    """Write the report of a result folder, of a job, or of a comparison of jobs as one HTML file.

    It has the error and the free run first, then equation, parameters, validation and
    residuals, and the other models in an appendix. It prints on A4. The figures are
    those in the folder: 'islands fit --figures all' draws all of them.
    """
    source, *others = sources
    folder = Path(source)
    if others:
        models = [_parse_model(each) for each in sources]
        with open_client(url, key) as client:
            page = client.comparison_report(models)
        path = out or Path("comparison.html")
    elif folder.exists():
        # The models take a second to import.
        from islands.report.pages.saved_result import report_saved_result  # noqa: PLC0415

        page = report_saved_result(folder)
        path = out or (folder if folder.is_dir() else folder.parent) / REPORT_FILE
    elif not _JOB_ID.fullmatch(source):
        raise SettingsError(f"there is no folder {source}: give the folder of a result, or the id of a job")
    else:
        with open_client(url, key) as client:
            page = client.report(source)
        path = out or Path(f"report-{source[:8]}.html")
    path.write_bytes(page)
    output.print(path, markup=False, highlight=False, soft_wrap=True)


def _parse_model(text: str) -> str | tuple[str, int]:
    found = _MODEL.fullmatch(text)
    if found is None:
        raise SettingsError(f"{text} is no job: a comparison has ids of jobs, JOB or JOB:RANK")
    job, rank = found.groups()
    return job if rank is None else (job, int(rank))
