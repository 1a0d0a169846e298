"""Records of several outputs: one grid, one split, and clear errors."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import RecordError, SettingsError
from islands.records.coupled import CoupledRecord, split_coupled
from islands.records.dataset import Dataset
from islands.records.preprocessing import preprocess

U = np.random.default_rng(4).normal(size=40)
Y = np.random.default_rng(5).normal(size=(2, 40))
ONE = Dataset(U, Y[0], 0.5, ("u_V",), "a_m", ("V",), "m", segments=(30, 10))
TWO = replace(ONE, y=Y[1], output_name="b_K", output_unit="K")


def test_the_record_of_an_output_has_the_others_as_inputs() -> None:
    separate = CoupledRecord((ONE, TWO)).separate(1)
    assert (separate.input_names, separate.input_units) == (("u_V", "a_m"), ("V", "m"))
    np.testing.assert_array_equal(separate.u, np.column_stack([U, Y[0]]))
    np.testing.assert_array_equal(separate.y, Y[1])


@pytest.mark.parametrize(
    ("records", "message"),
    [
        ((ONE,), "at least two outputs"),
        ((ONE, ONE), "a_m is given twice"),
        ((ONE, replace(TWO, output_name="u_V", output_unit="V")), "u_V is an input and an output"),
        (
            tuple(replace(each, input_names=("b_K+1",), input_units=("K",)) for each in (ONE, TWO)),
            "input and an output",
        ),
        ((ONE, replace(TWO, segments=(10, 30))), "differ in their inputs"),
        ((ONE, replace(TWO, u=2.0 * U)), "differ in their inputs"),
    ],
)
def test_outputs_that_do_not_fit_together_are_refused(records, message) -> None:
    with pytest.raises(RecordError, match=message):
        CoupledRecord(records)


def test_a_sample_without_one_output_is_skipped_for_all() -> None:
    one, two = (np.where(np.arange(40) == gap, np.nan, each) for gap, each in zip((5, 20), Y, strict=True))
    record = CoupledRecord((replace(ONE, y=one), replace(TWO, y=two))).skip_missing()
    assert record.records[0].segments == (5, 14, 9, 10)
    np.testing.assert_array_equal(record.y, np.delete(Y, (5, 20), axis=1).T)
    with pytest.raises(RecordError, match="no sample has a value"):
        CoupledRecord(
            (
                replace(ONE, y=np.where(np.arange(40) < 20, np.nan, one)),
                replace(TWO, y=np.where(np.arange(40) >= 20, np.nan, two)),
            )
        ).skip_missing()


def test_validation_data_are_other_samples_of_the_same_outputs() -> None:
    record = CoupledRecord((ONE, TWO))
    with pytest.raises(SettingsError, match="samples that are used for estimation"):
        split_coupled(record, record)
    with pytest.raises(RecordError, match="the same outputs in one order"):
        split_coupled(record, CoupledRecord((TWO, ONE)))


def test_functions_of_one_output_refuse_several_and_say_what_to_do():
    record = CoupledRecord((ONE, TWO))
    with pytest.raises(SettingsError, match=r"of several outputs, take record\.map"):
        preprocess(record, detrend="constant")
    centred = record.map(lambda each: preprocess(each, detrend="constant"))
    assert np.abs(centred.y.mean(axis=0)).max() < 1e-12
