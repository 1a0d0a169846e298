"""The table of terms is the equation, in lines of a terminal."""

import re

import pytest

from islands.expressions.parsing import parse
from islands.models.equations import named_equation
from islands.models.narx import make_model
from islands.report.text.layout import front_table, term_table, write_html

LONG = "y(k-1)*sign(u(k-10) - u(k-11))*(u(k-1) - u(k-2))*abs(u(k-7) - u(k-8))"


@pytest.fixture
def model():
    terms = [("y(k-1)", 1.0), (LONG, -0.00078), ("1", 2.5), ("u(k-1)^2*(u(k-1) - u(k-2))", 1.5e-9)]
    made = make_model(
        [(parse(text), value) for text, value in terms], ("drive current (A)",), "position [mm]"
    )
    return made.with_parameters(made.parameters, [0.0 if theta == 1.0 else 1e-3 for theta in made.parameters])


def test_the_lines_are_the_equation(model):
    rows = [re.sub(r" +(standard error|fixed|0\.001)$", "", line) for line in term_table(model)]
    compact = re.sub(r"\s", "", "".join(rows)).replace("=+1*", "=")
    assert compact == re.sub(r"\s", "", named_equation(model))


def test_the_lines_fit_into_a_terminal_and_end_with_the_standard_errors(model):
    lines = term_table(model)
    assert max(map(len, lines)) <= 80
    assert lines[0].endswith("standard error")
    assert [line.split()[-1] for line in lines if line.startswith("  ") and len(line) == 80] == [
        "fixed" if theta == 1.0 else "0.001" for theta in model.parameters
    ]


def test_names_between_backticks_are_code_in_html():
    assert write_html("a < b: dry friction (`coulomb-friction`)") == (
        "a &lt; b: dry friction (<code>coulomb-friction</code>)"
    )


def test_a_model_without_standard_errors_has_no_column_for_them(model):
    bare = model.with_parameters(model.parameters)
    assert not any(word in " ".join(term_table(bare)) for word in ("standard error", "fixed"))


def test_the_front_has_a_line_for_every_model():
    def entry(rank, error, **changes):
        metrics = {"validation": {"free_run": {"rmse": error}}}
        return {"rank": rank, "recommended": rank == 1, "size": 3, "metrics": metrics, **changes}

    equation = "y(k) = " + " + ".join(f"{place}*u(k-{place})" for place in range(1, 20))
    models = [
        entry(1, 0.25, form="curve", structure="order 2, cube", equation="y(k) = x1(k)\nx1(k) = u(k-1)"),
        entry(2, None, form="equation", equation=equation),
    ]
    columns = {"names": {"output": "y"}, "units": {"output": "mm"}}
    heading, *lines, legend = front_table({"record": columns, "models": models})
    assert heading.split() == ["rank", "form", "size", "RMSE", "val.", "mm", "y(k)", "="]
    assert lines[0].split("  ")[-1] == "order 2, cube"
    assert lines[1].endswith("...")
    assert "diverged  1*u(k-1) + 2*u(k-2)" in lines[1]
    assert max(map(len, [heading, *lines, legend])) <= 80
