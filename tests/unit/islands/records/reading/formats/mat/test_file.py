"""MAT-files of every version: columns are read back, and other variables do no harm."""

from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.sparse import csc_array

from islands.errors import RecordError
from islands.records.reading import read_columns, read_record
from islands.records.reading.formats.mat.file import read_matlab
from islands.records.reading.formats.mat.workspace import ADVICE, MOST_CHANNELS

VERSIONS = ["4", "6", "7", "7.3"]
WITH_STRUCTURES = VERSIONS[1:]

SAMPLES = 50
T = 0.01 * np.arange(SAMPLES)
U = np.sin(7 * T)
Y = 2.5 * np.cos(5 * T)


def refusal(file, inputs=("u",), output="y", **options):
    with pytest.raises(RecordError) as caught:
        read_record(file, inputs, output, **options)
    return str(caught.value)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("shape", [(SAMPLES, 1), (1, SAMPLES)])
def test_row_and_column_vectors_are_columns(save, version, shape):
    file = save(version, u=U.reshape(shape), y=Y.reshape(shape), t=T.reshape(shape))
    record = read_record(file, ["u"], "y")
    assert sorted(read_columns(file)) == ["t", "u", "y"]
    assert record.u[:, 0].tolist() == U.tolist()
    assert record.y.tolist() == Y.tolist()
    assert (record.dt, record.start) == (pytest.approx(0.01), 0.0)


@pytest.mark.parametrize("version", WITH_STRUCTURES)
@pytest.mark.parametrize("kind", ["i1", "u2", "u4", "i8", "u8", "?"])
def test_integers_of_all_widths_and_logicals_are_read(save, version, kind):
    u = (np.arange(SAMPLES) % 2).astype(kind)
    record = read_record(save(version, u=u, y=Y, Ts=0.1), ["u"], "y")
    assert record.u[:3, 0].tolist() == [0.0, 1.0, 0.0]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize(("name", "value"), [("dt", 0.004), ("Ts", 0.004), ("fs", 250), ("Fs", 250.0)])
def test_a_file_may_state_its_sampling(save, version, name, value):
    record = read_record(save(version, u=U, y=Y, **{name: value}), ["u"], "y", rows=slice(10, None))
    assert record.dt == pytest.approx(0.004)
    assert record.start == pytest.approx(0.04)


# Matrices


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("turned", [False, True])
def test_a_matrix_of_a_few_channels_is_split_into_columns(save, version, turned):
    data = np.column_stack([T, U, Y])
    file = save(version, data=data.T if turned else data, Ts=0.01)
    assert sorted(read_columns(file)) == ["Ts", "data_1", "data_2", "data_3"]
    record = read_record(file, ["data_2"], "data_3")
    assert record.u[:, 0].tolist() == U.tolist()
    assert record.y.tolist() == Y.tolist()
    assert record.input_units == ("",)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("shape", [(4, 5), (SAMPLES, MOST_CHANNELS + 1), (SAMPLES, SAMPLES)])
def test_a_matrix_of_another_shape_is_refused_with_its_shape(save, version, shape):
    message = refusal(save(version, u=np.ones(shape), y=Y, Ts=0.1))
    assert f"r.mat: column u has the shape {shape}" in message
    assert "one array per channel" in message


# Structures


@pytest.mark.parametrize("version", WITH_STRUCTURES)
def test_the_fields_of_a_structure_are_columns(save, version):
    file = save(
        version, run={"u_V": U, "y_um": Y[None, :], "inner": {"w": U, "m": np.column_stack([U, Y])}}, Ts=1.0
    )
    assert {"run.u_V", "run.y_um", "run.inner.w", "run.inner.m_2", "Ts"} <= set(read_columns(file))
    record = read_record(file, ["run.u_V", "run.inner.m_2"], "run.y_um")
    assert record.u.tolist() == np.column_stack([U, Y]).tolist()
    assert record.y.tolist() == Y.tolist()
    assert (record.input_units[0], record.output_unit) == ("V", "um")


@pytest.mark.parametrize("version", WITH_STRUCTURES)
def test_each_structure_has_its_own_time_and_sampling_time(save, version):
    file = save(
        version,
        first={"u": U, "y": Y, "t": T + 1},
        second={"u": U, "y": Y, "Ts": 0.5},
        third={"u": U, "y": Y},
        t=T * 2,
    )
    first = read_record(file, ["first.u"], "first.y")
    assert (first.dt, first.start) == (pytest.approx(0.01), 1.0)
    assert read_record(file, ["third.u"], "third.y").dt == pytest.approx(0.02)
    second = read_record(save(version, second={"u": U, "y": Y, "Ts": 0.5}, Ts=7.0), ["second.u"], "second.y")
    assert second.dt == 0.5
    message = refusal(
        save(version, fourth={"u": U, "y": Y, "Ts": 0.25}, t=T * 2, other={"q": U, "Ts": 0.5}),
        ["fourth.u"],
        "fourth.y",
    )
    assert "0.02 s by column t and 0.25 s by array fourth.Ts" in message
    assert "0.5" not in message


# Unsupported classes


NO_CHANNELS = {
    "char": "volt",
    "cell": [1.0, 2.0],
    "complex": U + 1j,
    "sparse": csc_array(np.eye(3)),
}


@pytest.mark.parametrize("version", WITH_STRUCTURES)
@pytest.mark.parametrize("kind", NO_CHANNELS)
@pytest.mark.parametrize("place", ["odd", "run.odd"])
def test_an_unsupported_class_is_refused_with_advice_only_when_read(save, version, kind, place):
    odd = NO_CHANNELS[kind]
    file = save(
        version, u=U, y=Y, Ts=0.1, **({"odd": odd} if place == "odd" else {"run": {"odd": odd, "v": U}})
    )
    assert read_record(file, ["u"], "y").samples == SAMPLES
    assert place in read_columns(file)
    assert refusal(file, [place]) == (
        f"r.mat: column {place} holds {kind} where real numbers are expected: {ADVICE[kind].format(x=place)}"
    )


@pytest.mark.parametrize("version", ["6", "7"])
def test_an_array_of_structures_is_refused_with_advice(save, version):
    several = np.zeros((1, 2), dtype=[("u", object), ("y", object)])
    message = refusal(save(version, runs=several, y=Y, Ts=0.1), ["runs"])
    assert "column runs holds struct" in message
    assert "run1 = runs(1)" in message


@pytest.mark.parametrize("compressed", [False, True])
def test_a_capture_of_controldesk_has_the_channels_by_their_names(tmp_path, compressed):
    axis = np.zeros((1, 1), dtype=[(field, object) for field in ("Name", "Data", "Unit")])
    axis[0, 0] = "", T[None], "s"
    channels = np.zeros((1, 2), dtype=[(field, object) for field in ("Name", "Data", "Unit", "XIndex")])
    channels[0, 0] = '"Model Root"/DAC/voltage', U[None], "V", 1.0
    channels[0, 1] = '"Model Root"/Enc.1/Größe\\Out1', Y[None], "", 1.0
    capture = {"X": axis, "Y": channels, "RTProgram": "plant.sdf", "Capture": {"Length": 0.5}}
    scipy.io.savemat(tmp_path / "run_1.mat", {"run_1": capture}, do_compression=compressed)
    inputs = ["run_1.Model Root/DAC/voltage [V]"]
    record = read_record(tmp_path / "run_1.mat", inputs, "run_1.Model Root/Enc/1/Größe\\Out1")
    assert (record.u[:, 0].tolist(), record.y.tolist()) == (U.tolist(), Y.tolist())
    assert (record.dt, record.input_units) == (pytest.approx(0.01), ("V",))


@pytest.mark.parametrize("version", WITH_STRUCTURES)
def test_an_empty_matrix_is_refused_with_its_shape(save, version):
    message = refusal(save(version, u=np.empty((0, 0)), y=Y, Ts=0.1))
    assert "column u has the shape (0, 0)" in message


# Files of other programs


def numbers_by_scipy(file):
    try:
        variables = scipy.io.loadmat(file)
    except Exception:  # some are intentionally damaged
        return {}
    return {
        name: value
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and not name.startswith("__")
    }


def test_samples_of_matlab_4_to_7_4_have_the_same_numbers_as_in_scipy():
    """The files were written by MATLAB on Solaris, Linux and Windows, in both byte orders."""
    folder = Path(scipy.io.__file__).parent / "matlab" / "tests" / "data"
    compared = 0
    for file in folder.glob("*.mat"):
        for name, value in numbers_by_scipy(file).items():
            assert np.array_equal(read_matlab(file).load(name), value), (file, name)
            compared += 1
    if not folder.exists():
        pytest.skip("SciPy was installed without its samples")
    assert compared > 30
