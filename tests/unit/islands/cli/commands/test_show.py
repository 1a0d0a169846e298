"""``islands show``: figures of a model on a record."""

import pytest

from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.persistence.models import write_model
from islands.records.writer import write_record
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
