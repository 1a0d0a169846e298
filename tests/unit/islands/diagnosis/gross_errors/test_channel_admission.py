"""Admission of channels: copies of the input and the output are not causes, other channels are kept."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.gross_errors.channel_admission import admit_channels
from islands.effects.catalogue import CATALOGUE
from islands.records.dataset import Dataset
from islands.report.documents.diagnosis_json import diagnosis_document
from support.simulated_records import recorded, wave

RNG = np.random.default_rng(0)
U = wave(300)
RECORD = recorded(U, 0.8 * U + 0.05 * RNG.standard_normal(U.size))


def with_channel(signal: np.ndarray, unit: str = "V") -> Dataset:
    return replace(
        RECORD,
        u=np.column_stack([U, signal]),
        input_names=("u_V", f"w_{unit}"),
        input_units=("V", unit),
    )


COPIES = {
    "the input": (U, "u_V", 1.0),
    "the input in another unit": (1e-3 * U, "u_V", 1e-3),
    "the inverted input with an offset": (5.0 - U, "u_V", -1.0),
    "the output": (RECORD.y, "y_um", 1.0),
    "a second sensor of the output": (2 * RECORD.y + 0.05 * RNG.standard_normal(U.size), "y_um", 2.0),
    "the delayed output": (np.roll(RECORD.y, 2), "y_um", 1.0),
}


@pytest.mark.parametrize("case", COPIES)
def test_copy_of_another_signal_is_left_out_and_said(case: str) -> None:
    signal, original, factor = COPIES[case]
    record, (finding,) = admit_channels(with_channel(signal), 225)
    assert record.input_names == ("u_V",)
    assert finding.name == "duplicated-channel"
    assert f"Channel w_V is a copy of {original}" in finding.description
    assert finding.parameters["factor"][0] == pytest.approx(factor, rel=0.01)


OTHERS = {
    "a neighbour": (wave(301)[1:] * RNG.standard_normal(U.size), "V"),
    "a coupled neighbour": (U + 3.0 * RNG.standard_normal(U.size), "V"),
    "a temperature that the output follows": (RECORD.y + 0.1 * RNG.standard_normal(U.size), "K"),
}


@pytest.mark.parametrize("case", OTHERS)
def test_other_channel_is_kept(case: str) -> None:
    record = with_channel(*OTHERS[case])
    assert admit_channels(record, 225) == (record, ())


def test_channel_that_is_constant_until_the_hold_out_part_is_left_out() -> None:
    record, (finding,) = admit_channels(with_channel(np.maximum(np.arange(300) - 225, 0)), 225)
    assert record.input_names == ("u_V",)
    assert finding.name == "constant-channel"


@pytest.mark.ci
def test_copy_of_the_output_is_no_cause_of_a_gain() -> None:
    """Coupling of a copy of the output would explain the misfit."""
    found = islands.diagnose(
        with_channel(RECORD.y),
        "column:theirs",
        columns={"theirs": 0.7 * U},
        effects=(CATALOGUE["cross-coupling"], CATALOGUE["offset"]),
    )
    assert all(each.name != "cross-coupling" for each in found.effects)
    document = diagnosis_document(found)
    assert [each["name"] for each in document["record_findings"]] == ["duplicated-channel"]
    assert document["record"]["names"]["inputs"] == ["u_V"]
