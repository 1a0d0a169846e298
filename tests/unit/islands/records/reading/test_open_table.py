"""Gross errors of an output are missing values, and what was left out is stated."""

from dataclasses import replace

import numpy as np
import pandas
import pytest
from scipy.signal import lfilter

import islands
from islands.records.coupled import CoupledRecord
from islands.records.reading import read_dataset, read_record
from islands.records.reading.options import ReadingOptions
from islands.report.documents.result_folder import result_document
from support.bad_records import refusal

TIMES = 0.5 * np.arange(1200)
U = np.repeat(np.random.default_rng(7).uniform(0, 10, 120), 10)
Y = lfilter([0, 0.2], [1, -0.9], U) + np.random.default_rng(8).normal(0, 0.02, 1200)
PLACES = [150, 151, 700]


def with_values(values, column=Y):
    changed = column.copy()
    changed[PLACES] = values
    return changed


def write(path, u=U, y=Y):
    rows = [f"{t:g},{a:.9g},{b:.9g}" for t, a, b in zip(TIMES, u, y, strict=True)]
    path.write_text("\n".join(["t_s,u,y", *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("values", "errors"),
    [
        ((-50, -50, 60), "3 isolated spikes (line 152, line 153, line 702)"),
        (-9999, "3 times -9999, a code of missing values (line 152, line 153, line 702)"),
    ],
)
def test_gross_errors_of_the_output_are_missing_values(tmp_path, values, errors):
    file = write(tmp_path / "r.csv", y=with_values(values))
    record = read_record(file, ["u"], "y")
    assert np.flatnonzero(np.isnan(record.y)).tolist() == PLACES
    assert record.reading == (f"gross errors of y: {errors} are left out",)
    kept = read_record(file, ["u"], "y", outliers="keep")
    assert np.isfinite(kept.y).all()
    assert kept.reading == ()
    frame = pandas.DataFrame({"u": U, "y": with_values(values)}, index=TIMES)
    assert np.isnan(islands.as_record(frame, inputs="u", output="y").y[PLACES]).all()
    assert not np.isnan(islands.as_record(frame, inputs="u", output="y", outliers="keep").y).any()


def test_a_code_in_an_input_is_refused_without_gaps(tmp_path):
    rows = write(tmp_path / "r.csv", u=with_values(-9999, U)).read_text().splitlines()
    message = refusal(tmp_path, rows, inputs=("u",), output="y")
    assert message.startswith(
        "bad.csv, line 152, column u and 2 more of its cells are -9999, a code of missing"
    )
    assert 'gaps="split"' in message
    assert 'outliers="keep"' in message
    record = read_record(tmp_path / "bad.csv", ["u"], "y", gaps="split")
    assert record.segments == (150, 548, 499)
    assert record.reading[0] == "gross errors of u: 3 times -9999, a code of missing values are left out"
    assert read_record(tmp_path / "bad.csv", ["u"], "y", outliers="keep").u.min() == -9999


@pytest.mark.ci
@pytest.mark.parametrize(
    ("values", "errors"),
    [((-50, -50, 60), "3 isolated spikes"), (-9999, "3 times -9999, a code of missing values")],
)
def test_an_inspection_measures_facts_without_gross_errors_and_warns(tmp_path, values, errors):
    """The dead time of one sample became 60 to 120."""
    file = write(tmp_path / "r.csv", y=with_values(values))
    found = islands.inspect_record(file, ["u"], "y")
    assert found.find("dead-time").value == 1
    assert f"{errors} (line 152, line 153, line 702) are left out" in found.warnings[0]
    assert found.warnings[0].endswith('are left out (outliers="keep" uses them)')
    assert found.notes[0].rows == (150, 151, 700)
    kept = islands.inspect_record(file, ["u"], "y", reading=ReadingOptions(outliers="keep"))
    assert 'are used (outliers="exclude" leaves them out)' in kept.warnings[0]
    assert "--set outliers=keep" in kept.command


@pytest.mark.ci
@pytest.mark.parametrize("values", [(-50, -50, 60), pytest.param((-9999,) * 3, marks=pytest.mark.nightly)])
def test_the_law_is_found_in_a_record_with_gross_errors(tmp_path, values):
    result = islands.fit(read_record(write(tmp_path / "r.csv", y=with_values(values)), ["u"], "y"))
    system = result.linearise()
    assert system.poles == pytest.approx([0.9], abs=0.002)
    assert system.static_gain == pytest.approx(0.2 / (1.0 - 0.9), rel=0.01)
    assert result.best.metrics["validation"]["free_run"].rmse < 0.0215
    assert "3 isolated spikes" in str(result) or "3 times -9999" in str(result)


#: Positions and values of gross errors.
SPIKES = ((150, 700), (60.0, -50.0))

LINEAR = {"library": "polynomial", "degree": 1, "lags": 1, "max_terms": 2, "certificate": 0, "average": 1}


def read_with_spikes():
    wrong = Y.copy()
    wrong[list(SPIKES[0])] = SPIKES[1]
    return islands.as_record(U, wrong, 0.5)


def test_a_record_keeps_the_values_of_gross_errors():
    record = read_with_spikes()
    assert np.flatnonzero(np.isnan(record.y)).tolist() == list(SPIKES[0])
    assert record.measured[list(SPIKES[0])].tolist() == list(SPIKES[1])


def _fit(record, **changes):
    return result_document(islands.fit(record, **LINEAR | changes).search_result)["data"]


def _fit_outputs(record):
    other = replace(record, y=np.nan_to_num(record.y) ** 2, measured=None, output_name="z")
    found = islands.fit(CoupledRecord((record, other)), **LINEAR).search_result
    return result_document(found)["outputs"][0]["data"]


@pytest.mark.ci  # searches
@pytest.mark.parametrize(
    "find",
    [
        _fit,
        lambda record: _fit(record, average=2),
        lambda record: _fit(islands.preprocess(record, lowpass=0.3)),
        lambda record: _fit(islands.preprocess(record, decimate=2)),
        _fit_outputs,
        lambda record: islands.diagnose(record, "linear:1").document["data"],
    ],
    ids=["samples", "means", "filtered", "decimated", "outputs", "diagnosis"],
)
def test_every_result_states_its_errors_with_and_without_gross_errors(find):
    found = find(read_with_spikes())["left_out"]
    assert found["rmse_with"] > 2.0 * found["rmse"] > 0.0


@pytest.mark.parametrize("step", [0.02, 1.0 / 30.0])
def test_the_uniform_first_column_of_a_file_without_a_header_is_the_time(tmp_path, step):
    path = tmp_path / "r.csv"
    np.savetxt(path, np.column_stack([step * np.arange(len(U)), U, Y]), delimiter=",", fmt="%.3f")
    assert read_record(path, ["c2"], "c3", header=False).dt == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("held", [False, True])
def test_an_input_that_is_a_signal_is_read_at_the_samples_of_a_slow_output(tmp_path, held):
    """The output of a simulation is compared with a sample; its mean to the next sample is late."""
    rng = np.random.default_rng(3)
    u, y, simulated = rng.normal(size=900), rng.normal(size=90), rng.normal(size=900)
    cells = [f"{y[k // 10]:.6f}" if held or k % 10 == 0 else "" for k in range(900)]
    rows = [f"{0.01 * k:.2f},{u[k]:.6f},{simulated[k]:.6f},{cells[k]}" for k in range(900)]
    file = tmp_path / "r.csv"
    file.write_text("\n".join(["t_s,u,s,y", *rows]) + "\n")
    record = read_dataset(file, ["u", "s"], "y", signals=["s"])
    assert np.allclose(record.u[:, 1], simulated[::10], atol=1e-6)
    assert np.allclose(record.u[:, 0], u.reshape(-1, 10).mean(axis=1), atol=1e-6)
    assert "with the value at each for s, with the mean from each to the next for u" in record.reading[0]


def test_an_output_that_is_flat_at_an_extreme_is_stated(tmp_path):
    file = write(tmp_path / "r.csv", y=np.minimum(Y, np.quantile(Y, 0.9)))
    (note,) = read_record(file, ["u"], "y").reading
    assert note.startswith("y is flat at its maximum 14.21")
    assert note.endswith("in 9.7 % of the samples: it may be saturated; these samples are used")
    assert read_record(write(tmp_path / "s.csv"), ["u"], "y").reading == ()
    # The range of these numbers is infinite.
    signs = np.where(np.median(Y) < Y, 1.5e308, -1.5e308)
    huge = write(tmp_path / "t.csv", y=signs * (1.0 - 1e-3 * np.sin(Y)))
    assert read_record(huge, ["u"], "y").reading == ()
