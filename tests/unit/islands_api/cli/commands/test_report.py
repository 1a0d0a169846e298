"""``islands report``: the report of a folder or of a job as one file."""

from collections.abc import Callable
from pathlib import Path

import pytest

import islands
from islands.report.pages.saved_result import report_saved_result
from islands_api.cli.commands import report as command
from support.identifications import record

Run = Callable[..., tuple[int, str, str]]

JOB = "7b488b4dc9d4485093e81b062c0c6025"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    settings = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 1, "certificate": 0}
    return islands.fit(record(300), average=1, **settings).save(tmp_path / "result", figures=())


@pytest.mark.parametrize("options", [(), ("--out", "mine.html")])
def test_report_of_a_folder_is_written_into_it_or_where_it_is_asked_for(
    command_line: Run, folder: Path, options: tuple[str, ...]
) -> None:
    code, out, err = command_line("report", folder, *options)
    assert (code, err) == (0, "")
    expected = folder.parent / options[1] if options else folder / "report.html"
    assert Path(out.strip()).absolute() == expected
    assert expected.read_bytes() == report_saved_result(folder)


class Answering:
    """Client of a service that answers with the request."""

    def __enter__(self) -> "Answering":
        return self

    def __exit__(self, *_: object) -> None: ...

    def report(self, job: str) -> bytes:
        return f"report of {job}".encode()

    def comparison_report(self, models: list[str | tuple[str, int]]) -> bytes:
        return repr(models).encode()


def test_report_of_a_job_is_that_of_the_service(
    command_line: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = []
    monkeypatch.setattr(command, "open_client", lambda *given: asked.append(given) or Answering())
    code, out, _ = command_line("report", JOB, "--url", "http://there", "--key", "secret")
    assert (code, out.strip()) == (0, "report-7b488b4d.html")
    assert (tmp_path / "report-7b488b4d.html").read_text() == f"report of {JOB}"
    assert asked == [("http://there", "secret")]


def test_several_jobs_are_compared_by_the_recommended_model_or_that_of_a_rank(
    command_line: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(command, "open_client", lambda *_: Answering())
    code, out, _ = command_line("report", JOB, f"{JOB}:12")
    assert (code, out.strip()) == (0, "comparison.html")
    assert (tmp_path / "comparison.html").read_text() == repr([JOB, (JOB, 12)])
    code, _, err = command_line("report", JOB, "result")
    assert code == 2
    assert "result is no job: a comparison has ids of jobs, JOB or JOB:RANK" in err


def test_neither_folder_nor_job_is_an_error_with_advice(command_line: Run) -> None:
    code, _, err = command_line("report", "nothing")
    assert code == 2
    assert "there is no folder nothing: give the folder of a result, or the id of a job" in err
