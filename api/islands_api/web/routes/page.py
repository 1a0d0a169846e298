"""Dashboard at ``/`` and reference at ``/docs``: static files, which use REST like any other client."""

import gzip
import hashlib
from functools import cache
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Header, Response

from islands_api.web.problems import ResourceNotFoundError

router = APIRouter(include_in_schema=False)

DASHBOARD_DIR = Path(__file__).parents[2] / "dashboard"

_SCRIPT = "text/javascript; charset=utf-8"
_STYLE = "text/css; charset=utf-8"

#: Media types of the files of the dashboard. A new module needs an entry here, and a preload in
#: index.html if the lists of jobs and data import it.
FILES = {
    "index.html": "text/html; charset=utf-8",
    "docs.html": "text/html; charset=utf-8",
    "icon.svg": "image/svg+xml",
    "data.css": _STYLE,
    "docs.css": _STYLE,
    "islands.css": _STYLE,
    "job.css": _STYLE,
    "jobs.css": _STYLE,
    "live.css": _STYLE,
    "monitor.css": _STYLE,
    "try.css": _STYLE,
    "docs.js": _SCRIPT,
    "islands.js": _SCRIPT,
    "components/added_records.js": _SCRIPT,
    "components/banner.js": _SCRIPT,
    "components/chart.js": _SCRIPT,
    "components/chart_drawing.js": _SCRIPT,
    "components/column_choice.js": _SCRIPT,
    "components/compare_choice.js": _SCRIPT,
    "components/comparison_report.js": _SCRIPT,
    "components/confirm.js": _SCRIPT,
    "components/convergence.js": _SCRIPT,
    "components/dataset.js": _SCRIPT,
    "components/diagnosing/causes.js": _SCRIPT,
    "components/diagnosing/diagnosis_form.js": _SCRIPT,
    "components/diagnosing/equations_editor.js": _SCRIPT,
    "components/diagnosing/fmu_fields.js": _SCRIPT,
    "components/diagnosing/next_experiment.js": _SCRIPT,
    "components/diagnosing/outputs_plot.js": _SCRIPT,
    "components/diagnosing/parameter_fields.js": _SCRIPT,
    "components/diagnosing/simulation_choice.js": _SCRIPT,
    "components/diagnosing/simulation_preview.js": _SCRIPT,
    "components/diagnosis.js": _SCRIPT,
    "components/equation.js": _SCRIPT,
    "components/excitation_form.js": _SCRIPT,
    "components/figure_files.js": _SCRIPT,
    "components/figures.js": _SCRIPT,
    "components/file_upload.js": _SCRIPT,
    "components/island_map.js": _SCRIPT,
    "components/job_comparison.js": _SCRIPT,
    "components/job_failure.js": _SCRIPT,
    "components/job_filters.js": _SCRIPT,
    "components/job_labels.js": _SCRIPT,
    "components/job_phase.js": _SCRIPT,
    "components/job_request.js": _SCRIPT,
    "components/job_row.js": _SCRIPT,
    "components/job_selection.js": _SCRIPT,
    "components/linear_system.js": _SCRIPT,
    "components/job_state.js": _SCRIPT,
    "components/job_words.js": _SCRIPT,
    "components/loop_plot.js": _SCRIPT,
    "components/models.js": _SCRIPT,
    "components/monitoring/monitor_form.js": _SCRIPT,
    "components/monitoring/monitor_status.js": _SCRIPT,
    "components/monitoring/record_history.js": _SCRIPT,
    "components/monitoring/record_table.js": _SCRIPT,
    "components/monitoring/record_upload.js": _SCRIPT,
    "components/monitoring/state_charts.js": _SCRIPT,
    "components/paged_table.js": _SCRIPT,
    "components/record_notes.js": _SCRIPT,
    "components/refit.js": _SCRIPT,
    "components/report.js": _SCRIPT,
    "components/result_card.js": _SCRIPT,
    "components/row_ranges.js": _SCRIPT,
    "components/run_form.js": _SCRIPT,
    "components/scenario_upload.js": _SCRIPT,
    "components/search_run.js": _SCRIPT,
    "components/search_settings.js": _SCRIPT,
    "components/signal_lines.js": _SCRIPT,
    "components/signal_panels.js": _SCRIPT,
    "components/signal_plot.js": _SCRIPT,
    "components/signal_samples.js": _SCRIPT,
    "components/term_table.js": _SCRIPT,
    "components/try_model.js": _SCRIPT,
    "components/size_front.js": _SCRIPT,
    "lib/api.js": _SCRIPT,
    "lib/canvas.js": _SCRIPT,
    "lib/clock.js": _SCRIPT,
    "lib/dom.js": _SCRIPT,
    "lib/numbers.js": _SCRIPT,
    "lib/polling.js": _SCRIPT,
    "lib/scale.js": _SCRIPT,
    "lib/schema.js": _SCRIPT,
    "lib/toml.js": _SCRIPT,
    "pages/compare.js": _SCRIPT,
    "pages/data.js": _SCRIPT,
    "pages/dataset.js": _SCRIPT,
    "pages/job.js": _SCRIPT,
    "pages/jobs.js": _SCRIPT,
    "pages/key.js": _SCRIPT,
    "pages/monitor.js": _SCRIPT,
    "pages/monitors.js": _SCRIPT,
}


@cache
def _read_file(name: str) -> tuple[bytes, bytes, str]:
    """Return the bytes of a file, the compressed ones, and its ETag."""
    data = (DASHBOARD_DIR / name).read_bytes()
    return data, gzip.compress(data, mtime=0), f'W/"{hashlib.sha256(data).hexdigest()[:16]}"'


@router.get("/")
async def index(
    if_none_match: Annotated[str | None, Header()] = None,
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:
    """Return the dashboard."""
    return _file_response("index.html", if_none_match, accept_encoding)


@router.get("/docs")
async def docs(
    if_none_match: Annotated[str | None, Header()] = None,
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:
    """Return the reference of the REST interface, which shows ``openapi.json``."""
    return _file_response("docs.html", if_none_match, accept_encoding)


@router.get("/dashboard/{name:path}")
async def file(
    name: str,
    if_none_match: Annotated[str | None, Header()] = None,
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:
    """Return a file of the dashboard."""
    if name not in FILES:
        raise ResourceNotFoundError(f"the dashboard has no file {name!r}")
    return _file_response(name, if_none_match, accept_encoding)


def _file_response(name: str, if_none_match: str | None, accept_encoding: str) -> Response:
    data, compressed, etag = _read_file(name)
    headers = {"Cache-Control": "no-cache", "ETag": etag, "Vary": "Accept-Encoding"}
    if if_none_match == etag:
        return Response(status_code=304, headers=headers)
    # A browser that refuses an encoding by "gzip;q=0" is not known.
    if "gzip" in accept_encoding:
        return Response(compressed, media_type=FILES[name], headers=headers | {"Content-Encoding": "gzip"})
    return Response(data, media_type=FILES[name], headers=headers)
