"""Programs of all formats start alike, and compute what the free run of the model does, sample for sample."""

from itertools import product

import numpy as np
import pytest

from islands.export import EXPORTS, FILE_EXPORTS
from islands.simulation.initial_states import find_first_states
from islands.simulation.predictors import free_run
from support.block_cases import OF_BLOCKS, Run, record_of_class, start_by_default, start_from_record
from support.exported_programs import BUILDERS

#: Formats that are no programs.
TEXTS = {"plain", "latex", "mathml", "json"}

STARTS = {"from a record": start_from_record, "by default": start_by_default}

#: Models of which every format is run for every change. The programs of the others are in C and Python, whose
#: equations the further formats have; those are run at night.
_ESSENTIAL = ("own primitive", "deviations at once", "two masses", "state space")


def _list_cells():
    for (kind, (build, need)), name in product(BUILDERS.items(), OF_BLOCKS):
        if need:
            is_rare = kind != "c" and name not in _ESSENTIAL
            marks = [need, pytest.mark.nightly if is_rare else pytest.mark.ci]
            yield pytest.param(build, name, [*STARTS], marks=marks, id=f"{kind}, {name}")
            continue
        for start in STARTS:
            if (kind, name) == ("modelica", "own primitive"):  # refused
                continue
            yield pytest.param(build, name, [start], id=f"{kind}, {name}, {start}")


@pytest.mark.parametrize(("build", "name", "starts"), [*_list_cells()])
def test_a_program_computes_the_free_run(build, name, starts, tmp_path):
    program = build(OF_BLOCKS[name], tmp_path)
    for start in starts:
        run, expected = STARTS[start](name)
        found = program(run)[:, : expected.shape[1]]
        # An FMU whose input acts at once has no output at the last sample.
        known = np.isfinite(found[:, 0])
        assert known[:-1].all()
        # Only the offsets of fed back outputs, and the functions of another library, are rounded otherwise.
        np.testing.assert_allclose(found[known], expected[known], rtol=1e-13, atol=1e-15, err_msg=start)


@pytest.mark.ci
@pytest.mark.parametrize(
    "name",
    ["state space", "state space at once", "state space with dead times", "state spaces of deviations"],
)
def test_a_program_repeats_the_free_run_from_the_estimated_states(name):
    model = OF_BLOCKS[name]
    u, _, record = record_of_class(model)
    sample, states = find_first_states(model, record, model.maximum_lag)
    run = Run(None, u, u[sample:], 0, u[:0], tuple(states.values()))
    found = BUILDERS["python"][0](model, None)(run)
    expected = free_run(model, record).y.reshape(len(u), -1)
    np.testing.assert_allclose(
        found[model.maximum_lag - sample :], expected[model.maximum_lag :], rtol=1e-12, atol=1e-12
    )


def test_all_formats_are_compared():
    assert {*BUILDERS, *TEXTS} == {*EXPORTS, *FILE_EXPORTS}
