"""Exported programs of coupled models have the bits of the simulation."""

import ctypes
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from islands.data.coupled_record import CoupledRecord
from islands.data.dataset import Dataset
from islands.errors import SettingsError
from islands.export import EXPORTS, export
from islands.models.coupled_narx import CoupledModel
from islands.simulation.predictors import free_run
from support.coupled_systems import PREY, TWO_MASSES, equation, make_coupled_record

_TERMS = {"y(k-1)": 0.5, "max(u1(k-1), u3(k-2))": 0.1, "u2(k-1)*u4(k-1)*y(k-2)": -0.2, "1": 0.1 + 0.2}

#: Three outputs, two inputs, one of which acts within the sample, and names that end comments and strings.
THREE = CoupledModel(
    tuple(
        equation(_TERMS, ("u+1", '*/"""', *(other for other in ("a", "b\n", "c") if other != name)), name)
        for name in ("a", "b\n", "c")
    )
)

MODELS = {"two masses": TWO_MASSES, "prey": PREY, "three": THREE}


def record_of(model):
    if model is not THREE:
        return make_coupled_record(model, samples=60, noise=0.05)
    values = np.random.default_rng(8).uniform(-0.5, 0.5, size=(60, 5))
    names = ("u", model.input_names[1])
    return CoupledRecord(
        tuple(
            Dataset(values[:, :2], values[:, 2 + place], 0.1, names, name)
            for place, name in enumerate(model.output_names)
        )
    )


def channels_of(model):
    """Return the inputs, the outputs with their first samples, and the expected outputs."""
    record = record_of(model)
    expected = free_run(model, record).y
    expected[: model.maximum_lag] = record.y[: model.maximum_lag]
    return record.records[0].u.T, record.y.T, expected.T


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_python_module_has_the_bits_of_the_simulation(model) -> None:
    u, y, expected = channels_of(model)
    module = {}
    exec(export(model, "python"), module)
    # The last sample of an input that acts within the sample is known to the simulation, too.
    found = module["simulate"](*u.tolist(), *y.tolist())
    np.testing.assert_array_equal(found, expected)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_c_file_has_the_bits_of_the_simulation(model, tmp_path) -> None:
    u, y, expected = channels_of(model)
    (tmp_path / "model.c").write_text(export(model, "c"), encoding="ascii")
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2", "-ffp-contract=off"]
    subprocess.run(
        ["gcc", *flags, "-shared", "-fPIC", "model.c", "-o", "model.so", "-lm"], cwd=tmp_path, check=True
    )
    pointer = ctypes.POINTER(ctypes.c_double)
    rows = [np.ascontiguousarray(row).copy() for row in [*u, *y]]
    ctypes.CDLL(tmp_path / "model.so").simulate(
        *(row.ctypes.data_as(pointer) for row in rows), ctypes.c_size_t(len(rows[0]))
    )
    np.testing.assert_array_equal(rows[len(u) :], expected)


@pytest.mark.ci
@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Octave")
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_matlab_function_has_the_numbers_of_the_simulation(model, tmp_path) -> None:
    u, y, expected = channels_of(model)
    (tmp_path / "coupled_narx_model.m").write_text(export(model, "matlab"), encoding="ascii")
    rows = [f"[{','.join(map(repr, row.tolist()))}]" for row in [*u, *y]]
    outputs = [f"z{place}" for place in range(len(y))]
    program = f"[{','.join(outputs)}] = coupled_narx_model({','.join(rows)}); "
    program += f"printf('%.17g\\n', [{';'.join(outputs)}]');"
    done = subprocess.run(
        ["octave-cli", "--quiet", "--eval", program], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    np.testing.assert_allclose(
        np.fromstring(done.stdout, sep="\n").reshape(expected.shape), expected, rtol=1e-12
    )


def test_equations_name_the_columns_of_the_record() -> None:
    assert export(TWO_MASSES, "plain").splitlines() == [
        "y1(k) = 1.6*y1(k-1) - 0.8*y1(k-2) + 0.1*u(k-1) + 0.05*y2(k-1)",
        "y2(k) = 1.5*y2(k-1) - 0.7*y2(k-2) + 0.12*y1(k-1) - 0.04*y1(k-2)",
    ]


def test_latex_and_mathml_number_the_outputs() -> None:
    rows = export(PREY, "latex").splitlines()
    assert rows[0] == r"\begin{aligned}"
    assert rows[1].startswith("y_{1,k} &= ")
    assert "y_{2,k-1}" in rows[1]
    assert "u_{k-1}" in rows[1]
    first, second = export(PREY, "mathml").splitlines()
    assert "<mi>y</mi><mrow><mn>2</mn><mo>,</mo><mi>k</mi>" in first
    assert "<mi>u</mi><mrow><mi>k</mi>" in first
    assert "<mi>u</mi>" not in second


def test_an_unknown_format_names_the_others() -> None:
    with pytest.raises(SettingsError, match=r"'fortran'.* plain, latex"):
        export(PREY, "fortran")
    renamed = CoupledModel(tuple(replace(each) for each in PREY.models))
    assert all(export(renamed, kind) for kind in EXPORTS)


def test_a_sampling_time_is_stated_without_its_rounding_error() -> None:
    """It was 0.09999999999999999 s."""
    made = CoupledModel(tuple(replace(each, dt=0.3 - 0.2) for each in TWO_MASSES.models))
    assert "sampling time 0.1 s." in export(made, "c")
