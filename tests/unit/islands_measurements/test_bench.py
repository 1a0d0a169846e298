"""``islands bench``: messages, report and failure of the measuring process."""

from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from islands.errors import SettingsError
from islands_measurements import bench as module
from support.made_reports import KINDS, comparison, report


@pytest.fixture
def ends():
    receiving, sending = Pipe(duplex=False)
    yield receiving, sending
    receiving.close()
    sending.close()


def test_progress_is_shown_until_the_report_arrives(ends):
    receiving, sending = ends
    made, shown = report(), []
    for message in (("one", 0.25), ("two", 0.5), made, ("after", 1.0)):
        sending.send(message)
    assert module._receive_report(receiving, lambda text, share: shown.append((text, share))) == made
    assert shown == [("one", 0.25), ("two", 0.5)]


def test_error_of_the_measuring_process_is_raised(ends):
    receiving, sending = ends
    sending.send(SettingsError("set OPENBLAS_NUM_THREADS=1"))
    with pytest.raises(SettingsError, match="OPENBLAS"):
        module._receive_report(receiving, lambda _text, _share: None)


def test_killed_measuring_process_raises_an_error(ends):
    receiving, sending = ends
    sending.send(("one", 0.25))
    sending.close()
    with pytest.raises(ChildProcessError, match="measuring process ended early"):
        module._receive_report(receiving, lambda _text, _share: None)


def printed(changed, capsys):
    """Return the printed report in one line."""
    module._print_report(changed)
    return " ".join(capsys.readouterr().out.split())


def test_report_shows_both_sides_and_all_goals(capsys):
    text = printed(report(), capsys)
    for part in ("24.000", "0.300", "0.080", "12500", "25000", "9.5 s", "abababababab", "a processor"):
        assert part in text
    assert text.count("yes") == 11
    assert " no " not in text.replace("no compiler called cc", "")


def test_report_shows_missed_goals_and_absent_sides(capsys):
    kinds = {
        kind: replace(comparison(), c_simulation_ms=None, simulation_fraction_of_c=None) for kind in KINDS
    }
    text = printed(report(kinds=kinds, case1_wall_s=21.0), capsys)
    assert "21.0 s" in text
    assert text.count(" no │") == 1
    assert text.count("no C compiler") == 2


@pytest.mark.parametrize("option", ["--out", "--json"])
def test_unwritable_output_is_rejected_before_measuring(tmp_path, option):
    (tmp_path / "file").write_text("", encoding="utf-8")
    app = typer.Typer()
    app.command()(module.bench)
    target = tmp_path / "file" / ("folder" if option == "--out" else "report.json")
    found = CliRunner().invoke(app, ["--quick", "--out", str(tmp_path / "new"), option, str(target)])
    assert isinstance(found.exception, SettingsError)
    assert str(Path("file")) in str(found.exception)
    assert not (tmp_path / "new").exists()
