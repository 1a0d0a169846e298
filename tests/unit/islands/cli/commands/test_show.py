"""``islands show``: figures of a model on a record, and the report of a folder."""

from pathlib import Path

import pytest

import islands
from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.persistence.models import write_model
from islands.records.writer import write_record
from islands.report.pages.identification import report_saved_result
from support.identifications import record as make_record
from support.searches import record
from support.undrawn import undrawn_figures


@pytest.fixture
def model(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    write_record(record(), "r.csv")
    write_model(make_model([(parse("y(k-1)"), 0.9), (parse("u(k-1)"), 0.1)], ("u",)), "model.json")


def test_a_figure_of_a_model_on_a_record_is_drawn(model, command_line, tmp_path):
    with undrawn_figures():
        code, out, error = command_line(
            "show", "model.json", "--figure", "loop", "--record", "r.csv", "--out", "l.svg"
        )
    assert (code, out, error) == (0, "", "")
    assert (tmp_path / "l.svg").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--figure", "loops"), "figure"),
        (("--figure", "loop"), "give --record FILE and --out FILE"),
        (("--record", "r.csv"), "--record is for --figure"),
    ],
)
def test_options_of_a_figure_without_the_others_are_refused(model, command_line, options, message):
    code, _, error = command_line("show", "model.json", *options)
    assert code == 2
    assert message in error


@pytest.mark.ci
@pytest.mark.parametrize("options", [(), ("--out", "mine.html")])
def test_report_of_a_folder_is_written_into_it_or_where_it_is_asked_for(command_line, tmp_path, options):
    settings = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 1, "certificate": 0}
    folder = islands.fit(make_record(300), average=1, **settings).save(tmp_path / "result", figures=())
    code, out, error = command_line("show", folder, "--format", "report", *options)
    assert (code, error) == (0, "")
    expected = tmp_path / options[1] if options else folder / "report.html"
    assert Path(out.strip()).absolute() == expected
    system = islands.load(folder).best.linear_system
    assert expected.read_bytes() == report_saved_result(folder, system)
    code, out, _ = command_line("show", folder, "--format", "front")
    assert (code, len(out.splitlines())) == (0, 2 + len(islands.load(folder).models))


def test_a_report_of_no_folder_is_an_error_with_advice(command_line):
    code, _, error = command_line("show", "nothing", "--format", "report")
    assert (code, "there is no folder nothing" in error) == (2, True)


def test_the_front_of_a_model_file_is_an_error_with_advice(model, command_line):
    code, _, error = command_line("show", "model.json", "--format", "front")
    assert (code, "is not the folder of a result" in error) == (2, True)


def test_the_continuous_system_is_written_on_request(model, command_line):
    write_model(make_model([(parse("y(k-1)"), 0.9), (parse("u(k-1)"), 0.1)], ("u",), dt=0.1), "timed.json")
    code, out, _ = command_line("show", "timed.json", "--format", "transfer-function", "--continuous", "zoh")
    assert (code, "s + 1.053605" in out, "time constant 0.9491 s" in out) == (0, True, True)
    code, _, error = command_line("show", "timed.json", "--figure", "bode", "--continuous", "zoh")
    assert (code, "--continuous is for the formats" in error) == (2, True)


def test_a_linear_system_is_written_and_drawn_without_a_record(model, command_line, tmp_path):
    code, out, _ = command_line("show", "model.json", "--format", "transfer-function", "--at", "u=2")
    assert (code, "about u = 2" in out, "static gain of u 1" in out) == (0, True, True)
    assert command_line("show", "model.json", "--format", "state-space", "--out", "m.m")[0] == 0
    assert "sys = ss(A, B, C, D, -1);" in (tmp_path / "m.m").read_text()
    with undrawn_figures():
        assert command_line("show", "model.json", "--figure", "nyquist", "--out", "n.svg") == (0, "", "")
    code, _, error = command_line("show", "model.json", "--at", "u=2")
    assert (code, "--at is for the formats state-space, transfer-function" in error) == (2, True)
    code, _, error = command_line("show", "model.json", "--continuous", "zoh")
    assert (code, "--continuous is for the formats state-space, transfer-function" in error) == (2, True)
    code, _, error = command_line("show", "model.json", "--format", "state-space", "--continuous", "zoh")
    assert (code, "needs the sampling time of the model" in error) == (2, True)
    code, _, error = command_line("show", "model.json", "--format", "state-space", "--at", "u")
    assert (code, "--at u: write NAME=VALUE" in error) == (2, True)
