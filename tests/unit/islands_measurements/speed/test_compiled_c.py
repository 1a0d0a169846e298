"""Compiled C equals plain numpy for all flags; a missing compiler is reported."""

import numpy as np
import pytest

from islands.errors import ModelError
from islands.export.fmu.compiler import find_compiler
from islands_measurements.speed import compiled_c, plain_numpy
from islands_measurements.speed.compiled_c import compile_model
from islands_measurements.speed.machine import peak

WARM_UP, INTERVAL = 26, 20

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler named cc")


@needs_compiler
@pytest.mark.parametrize("flags", compiled_c.FLAGS)
def test_compiled_c_has_the_error_of_plain_numpy(record, candidates, flags, tmp_path):
    rows = compiled_c.row_pointers(record, WARM_UP, INTERVAL)
    assert rows.lanes > compiled_c.LANES, "two blocks, the second one incomplete"
    for each in (candidates[0], candidates[4]):
        simulate = compiled_c.simulation(each.regressors, each.theta, rows, flags, tmp_path)
        expected = plain_numpy.simulate(each.regressors, each.theta, record, WARM_UP, INTERVAL)
        assert simulate() == pytest.approx(expected, rel=1e-10)
        assert simulate() == simulate()


@needs_compiler
def test_individuals_in_one_folder_do_not_interfere(record, candidates, tmp_path):
    rows = compiled_c.row_pointers(record, WARM_UP, INTERVAL)
    calls = [
        compiled_c.simulation(each.regressors, each.theta, rows, compiled_c.FLAGS[0], tmp_path)
        for each in candidates[:2]
    ]
    expected = [
        plain_numpy.simulate(each.regressors, each.theta, record, WARM_UP, INTERVAL)
        for each in candidates[:2]
    ]
    assert [call() for call in calls] == pytest.approx(expected, rel=1e-10)


def test_row_contains_the_same_time_of_every_interval(record):
    rows = compiled_c.row_pointers(record, WARM_UP, INTERVAL)
    assert rows.u.shape == rows.y.shape == (2, WARM_UP + INTERVAL, compiled_c.LANES)
    assert rows.lanes == 130
    assert rows.y[1, 3, 7] == record.y[(104 + 7) * INTERVAL + 3]
    assert rows.u[0, 30, 0] == record.u[30, 0]
    assert (rows.y[1, :, 26:] == rows.y[0, :, :1]).all()
    assert rows.u.ctypes.data % 64 == rows.y.ctypes.data % 64 == 0


@needs_compiler
def test_compilation_error_contains_the_compilers_message(tmp_path):
    with pytest.raises(ModelError, match=r"does not compile [0-9a-f]+\.c: [\s\S]*error"):
        compile_model("int this is not C;", ("-O1",), tmp_path)


@needs_compiler
def test_peak_is_plausible_for_a_processor(tmp_path):
    found = peak(tmp_path)
    assert found is not None
    assert 1e8 < found < 1e12


def test_missing_compiler_gives_no_peak_and_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_compiler() is None
    assert peak(tmp_path) is None
    with pytest.raises(ModelError, match="install one"):
        compile_model("int one;", (), tmp_path)


@needs_compiler
def test_operations_of_all_chains_are_counted(tmp_path):
    """The C code of the peak returns two operations per element of every chain and round."""
    import ctypes

    from islands_measurements.speed import machine as module

    library = compile_model(module._SOURCE, module._FLAGS, tmp_path)
    library.multiply_add.restype = ctypes.c_double
    result = ctypes.c_double()
    once = library.multiply_add(ctypes.c_long(1), ctypes.c_double(0.5), ctypes.byref(result))
    # Chain i is i / 2 + 1 / 2 after one round; the sum over n chains is n (n + 1) / 4.
    chains = round((np.sqrt(1 + 16 * result.value) - 1) / 2)
    assert result.value == chains * (chains + 1) / 4
    assert once / (2 * chains) in {2, 4, 8}, "elements of a vector of 128, 256 or 512 bits"
    assert library.multiply_add(ctypes.c_long(9), ctypes.c_double(0.5), ctypes.byref(result)) == 9 * once
