"""S-function export: it compiles against a substitute of Simulink, which drives it like the free run."""

import numpy as np
import pytest

from islands.export import export
from support.block_cases import OF_BLOCKS, OF_STATES, block_case
from support.exported_programs import needs_compiler, run_s_function
from support.programs import bits


@pytest.mark.ci
@needs_compiler
@pytest.mark.parametrize("name", OF_BLOCKS)
def test_the_block_simulates_like_the_free_run(name, tmp_path):
    case = block_case(name)
    error, found = run_s_function(case, case.past, tmp_path)
    assert error is None
    np.testing.assert_allclose(found, case.outputs, rtol=1e-12, atol=0)


@needs_compiler
def test_an_empty_parameter_is_a_past_of_zeros(tmp_path):
    case = block_case("published 12")
    empty, zeros = (run_s_function(case, each, tmp_path)[1] for each in ([], np.zeros(len(case.past))))
    assert bits(empty) == bits(zeros)


@needs_compiler
@pytest.mark.parametrize(("count", "is_double"), [(3, True), (5, True), (4, False)])
def test_a_parameter_of_another_size_or_class_is_refused(count, is_double, tmp_path):
    error, _ = run_s_function(block_case("published 12"), np.zeros(count), tmp_path, is_double)
    assert error == b"the parameter has to be [] or a vector of 4 samples of class double"


def test_the_file_lists_ports_and_past_samples():
    text = export(OF_STATES["several inputs"], "s-function")
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 112
    assert "Input ports: u1, u2, u3." in text
    assert "y(k-1), u1(k-1), u2(k-1), u3(k-1), u3(k-2)" in text
