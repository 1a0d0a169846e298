"""C export: it compiles with strict warnings and simulates like the kernel."""

import ctypes
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import islands
from islands.errors import ModelError
from islands.export import export
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.user_primitive import primitive
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.systems.published_models import PUBLISHED
from lab.speed.compiled_c import compile_model
from support.block_cases import OF_STATES, start_from_record
from support.exported_programs import FLAGS, build_s_function, needs_compiler, pointer, run_c
from support.programs import (
    HOSTILE_NAMES,
    OF_THE_LIBRARY,
    at_the_edges,
    bits,
    model,
    record,
)
from support.strategies import models, part_of_the_examples


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("c")


def of_the_library(exported):
    return any(entry.name in OF_THE_LIBRARY for entry in exported.block().primitives)


@pytest.mark.ci
@needs_compiler
@part_of_the_examples(3)  # each is compiled
@given(models(), st.integers(0, 2**32 - 1))
def test_the_compiled_program_equals_the_model_bit_for_bit(folder, random_model, seed):
    assume(not of_the_library(random_model))
    data = record(2, seed)
    run = free_run(random_model, data)
    # The kernel stops a diverging free run at the bound; C continues to infinity.
    assume(run.outcome)
    lag = random_model.maximum_lag
    assert bits(run_c(random_model, data, folder)[lag:]) == bits(run.y[lag:])


@needs_compiler
@pytest.mark.parametrize("samples", [0, 1, 2, 3, 5])
def test_simulate_does_not_write_outside_its_range(samples, folder):
    exported = PUBLISHED["12"].model
    data, y = record(), np.arange(1.0, 9.0)
    simulate = compile_model(export(exported, "c"), FLAGS, folder).simulate
    simulate.restype = None
    simulate(pointer(data.u[:, 0].copy()), pointer(y), ctypes.c_size_t(samples))
    written = slice(3, max(samples, 3))
    assert np.delete(y, written).tolist() == np.delete(np.arange(1.0, 9.0), written).tolist()
    assert not np.isin(y[written], np.arange(1.0, 9.0)).any()


@pytest.mark.parametrize("kind", ["c", "matlab"])
@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_a_column_name_is_read_back_from_its_comment_line(name, kind):
    text = export(islands.make_model([(islands.parse("u(k-1)"), 2.0)], (name,), name), kind)
    assert text.isascii()
    (line,) = (line for line in text.split("\n") if "Inputs u = " in line)
    for signal in ("Inputs u = ", "output y = "):
        found, _ = json.JSONDecoder().raw_decode(line, line.index(signal) + len(signal))
        assert found == name
    assert line.endswith("; sampling time any.")


# User-defined primitives.


def saturation(a):
    return a / (1.0 + abs(a))


def blend(a, b):
    return 0.25 * a - b if a > 0.5 else b


OWN = {
    "saturation": primitive("saturation", saturation, c="return a / (1.0 + fabs(a));"),
    # Names of the language and of the exported program.
    "double": primitive("double", saturation, c="double size = fabs(a);\nreturn a / (1.0 + size);"),
    "predict": primitive("predict", blend, c="return a > 0.5 ? 0.25 * a - b : b;"),
    "f_sign": primitive("f_sign", blend, c="if (a > 0.5)\n    return 0.25 * a - b;\nreturn b;"),
}


@needs_compiler
@pytest.mark.parametrize("name", OWN)
def test_a_user_defined_primitive_is_compiled_with_its_body(name, folder):
    arguments = "u(k-1), y(k-1)" if OWN[name].arity == 2 else "u(k-1)"
    exported = model({f"{name}({arguments})*sign(u(k-2))": 0.3, "y(k-2)": 0.2}, primitives=PRIMITIVES | OWN)
    assert bits(run_c(exported, record(), folder)[2:]) == bits(free_run(exported, record()).y[2:])


@pytest.mark.parametrize(
    ("kind", "given"),
    [("c", "c='return a / (1.0 + fabs(a));'"), ("matlab", "matlab='r = a / (1 + abs(a));'")],
)
def test_a_user_defined_primitive_without_a_body_is_refused_with_advice(kind, given):
    known = PRIMITIVES | {"own": primitive("own", saturation)}
    with pytest.raises(ModelError) as caught:
        export(model({"own(u(k-1))": 1.0}, primitives=known), kind)
    assert str(caught.value) == (
        "primitive 'own' has no body in this language: pass the body of its function when you create it, "
        f"primitive('own', ..., {given})"
    )


@pytest.mark.parametrize("name", ["σ", "a" * 61])
@pytest.mark.parametrize("kind", ["c", "matlab"])
def test_a_primitive_with_an_invalid_identifier_is_refused(name, kind):
    known = PRIMITIVES | {name: primitive(name, saturation, c="return a;", matlab="r = a;")}
    with pytest.raises(ModelError, match="name it with at most 60 of the characters A-Z, a-z, 0-9 and _"):
        export(model({f"{name}(u(k-1))": 1.0}, primitives=known), kind)


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


@pytest.mark.ci
@needs_compiler
@pytest.mark.parametrize("name", PRIMITIVES)
def test_compiled_primitives_equal_the_kernels_at_jumps_and_limits(name, folder):
    exported, data = at_the_edges(name)
    ours, theirs = free_run(exported, data, bound=np.inf).y[1:], run_c(exported, data, folder)[1:]
    if name in OF_THE_LIBRARY:
        np.testing.assert_array_max_ulp(theirs, ours, maxulp=4)
    else:
        assert bits(theirs) == bits(ours)


@pytest.mark.ci
@needs_compiler
@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_a_column_name_cannot_break_the_file(name, folder):
    exported = islands.make_model([(islands.parse("u(k-1)"), 2.0)], (name,), name)
    data = Dataset([[1.0], [2.0]], [0.5, 0.0], 0.1)
    assert run_c(exported, data, folder).tolist() == [0.5, 2.0]
