"""Every text of an equation states the signals that the equation reads."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from islands.errors import ModelError
from islands.export import export
from islands.expressions.parsing import parse
from islands.models.coupled_narx import CoupledModel
from islands.models.equations import mathml_equation
from islands.models.narx import make_model
from islands.models.signal_statement import describe_signals
from islands.records.averaging import average_samples
from islands.records.dataset import Dataset
from islands.records.preprocessing import preprocess

RATE = "k counts steps of 0.08 s: each value is the mean of 2 values, each one of 4 samples of 0.01 s behind"

STATEMENTS = {
    (): "",
    (("average", 2),): "k counts steps of 0.02 s: each value is the mean of 2 samples of the record",
    (("detrend", "constant"),): "y is the deviation from 3.25 cm, u from 4.5 V",
    (("lowpass", 5.0),): (
        "k counts steps of 0.01 s: each value is a sample of 0.01 s behind a zero-phase low-pass "
        "filter of 5 Hz"
    ),
    (("decimate", 4), ("average", 2)): f"{RATE} a zero-phase low-pass filter of 10 Hz",
    (("lowpass", 5.0), ("decimate", 4), ("average", 2)): (
        f"{RATE} zero-phase low-pass filters of 5 Hz and 10 Hz"
    ),
}


def model_of(steps):
    """Return a model of a preprocessed record whose means are 3.25 cm and 4.5 V."""
    given = dict(steps)
    average = given.pop("average", 1)
    wave = np.tile([1.0, 1.0, -1.0, -1.0], 50)
    record = Dataset(4.5 + wave, 3.25 + wave, 0.01, ("pump (V)",), "level (cm)")
    prepared = average_samples(preprocess(record, **given), average)
    terms = [(parse("y(k-1)"), 0.5), (parse("u(k-1)"), 1.0)]
    model = make_model(terms, ("pump (V)",), "level (cm)", prepared.dt)
    return replace(model, average=average, preprocessing=prepared.preprocessing)


@pytest.mark.parametrize(("steps", "expected"), STATEMENTS.items(), ids=str)
def test_the_statement_names_offsets_filters_decimation_and_means(steps, expected):
    assert describe_signals(model_of(steps)) == expected


@pytest.mark.parametrize(("steps", "expected"), STATEMENTS.items(), ids=str)
def test_every_text_of_an_equation_has_the_statement(steps, expected):
    model = model_of(steps)
    equation, *stated = export(model, "plain").splitlines()
    assert equation == "y(k) = 0.5*y(k-1) + 1*u(k-1)"
    assert stated == ([f"where {expected}"] if expected else [])
    assert (rf"\text{{where {expected}}}" in export(model, "latex")) == bool(expected)
    rows = [each.text for each in ElementTree.fromstring(mathml_equation(model)).iter("mtext")]
    assert " ".join(rows) == (f"where {expected}" if expected else "")


def coupled(steps):
    """Return a model of two outputs, the second of which has the offset 6.5 cm."""
    one = model_of(steps)
    done = one.preprocessing
    two = done and replace(done, output_offset=2.0 * done.output_offset)
    offsets = (done.output_offset, two.output_offset) if done else (0.0, 0.0)
    return CoupledModel(
        tuple(
            replace(one, input_names=("pump (V)", other), output_name=name, preprocessing=each)
            for name, other, each in (
                ("a (cm)", "b (cm)", done and done.with_inputs(offsets[1:])),
                ("b (cm)", "a (cm)", two and two.with_inputs(offsets[:1])),
            )
        )
    )


def test_equations_of_other_signals_are_refused():
    model = coupled((("detrend", "constant"),))
    first, second = model.models
    with pytest.raises(ModelError, match="another preprocessing"):
        CoupledModel((first, replace(second, preprocessing=None)))
    with pytest.raises(ModelError, match="another preprocessing"):
        CoupledModel((first, replace(second, preprocessing=first.preprocessing)))
