"""``islands bench``: what the measuring process tells is shown, and its failure is not silent."""

from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from islands.errors import SettingsError
from islands_api.cli.commands import bench as module
from support.made_reports import KINDS, comparison, report


@pytest.fixture
def ends():
    receiving, sending = Pipe(duplex=False)
    yield receiving, sending
    receiving.close()
    sending.close()


def test_progress_is_told_until_the_report_comes(ends):
    receiving, sending = ends
    made, told = report(), []
    for message in (("one", 0.25), ("two", 0.5), made, ("after", 1.0)):
        sending.send(message)
    assert module._followed(receiving, lambda text, share: told.append((text, share))) == made
    assert told == [("one", 0.25), ("two", 0.5)]


def test_an_error_over_there_is_an_error_here(ends):
    receiving, sending = ends
    sending.send(SettingsError("set OPENBLAS_NUM_THREADS=1"))
    with pytest.raises(SettingsError, match="OPENBLAS"):
        module._followed(receiving, lambda _text, _share: None)


def test_a_process_that_dies_is_reported(ends):
    receiving, sending = ends
    sending.send(("one", 0.25))
    sending.close()
    with pytest.raises(ChildProcessError, match="ended before it was done"):
        module._followed(receiving, lambda _text, _share: None)


def shown(changed, capsys):
    module._show(changed)
    return " ".join(capsys.readouterr().out.split())


def test_both_sides_and_every_goal_are_shown(capsys):
    text = shown(report(), capsys)
    for part in ("24.000", "0.300", "0.080", "12500", "25000", "9.5 s", "abababababab", "a processor"):
        assert part in text
    assert text.count("yes") == 11
    assert " no " not in text.replace("no compiler called cc", "")


def test_a_goal_that_is_missed_and_a_side_that_is_absent_are_shown(capsys):
    kinds = {
        kind: replace(comparison(), c_simulation_ms=None, simulation_fraction_of_c=None) for kind in KINDS
    }
    text = shown(report(kinds=kinds, case1_wall_s=21.0), capsys)
    assert "21.0 s" in text
    assert text.count(" no │") == 1
    assert text.count("no C compiler") == 2


@pytest.mark.parametrize("option", ["--out", "--json"])
def test_a_place_where_nothing_can_be_written_is_refused_before_measuring(tmp_path, option):
    (tmp_path / "file").write_text("", encoding="utf-8")
    app = typer.Typer()
    app.command()(module.bench)
    asked = tmp_path / "file" / ("folder" if option == "--out" else "report.json")
    found = CliRunner().invoke(app, ["--quick", "--out", str(tmp_path / "new"), option, str(asked)])
    assert isinstance(found.exception, SettingsError)
    assert str(Path("file")) in str(found.exception)
    assert not (tmp_path / "new").exists()
