"""S-function export: its parameter, and its list of ports."""

from dataclasses import replace

import numpy as np
import pytest

from islands.export import export
from support.block_cases import OF_STATES, start_from_record
from support.exported_programs import build_s_function, needs_compiler


@needs_compiler
@pytest.mark.parametrize(("count", "is_double"), [(3, True), (5, True), (4, False)])
def test_a_parameter_of_another_size_or_class_is_refused(count, is_double, tmp_path):
    simulate = build_s_function(OF_STATES["published 12"], tmp_path)
    run, _ = start_from_record("published 12")
    with pytest.raises(AssertionError, match=r"has to be \[\] or a vector of 4 samples of class double"):
        simulate(replace(run, past=np.zeros(count)), is_double)


def test_the_file_lists_ports_and_past_samples():
    text = export(OF_STATES["several inputs"], "s-function")
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 112
    assert "Input ports: u1, u2, u3." in text
    assert "y(k-1), u1(k-1), u2(k-1), u3(k-1), u3(k-2)" in text
