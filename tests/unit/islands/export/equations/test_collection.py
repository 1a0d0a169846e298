"""Equations of an extended simulation: what has no program is refused, and the message names it."""

import pytest

from islands.errors import ModelError
from islands.export.equations.collection import collect_equations
from islands.export.extension import EXTENDED_EXPORTS, export_extended
from islands.expressions.tree import Symbol
from islands.simulators.specification.table import LocalExtendedSpec
from support.simulated_records import DT, MODEL

PIEZO = {"kind": "bouc-wen-piezo"}
SPRING = {"kind": "second-order", "parameters": {"m": 0.5, "c": 4.0, "k": 200.0}}
LINEAR = {"kind": "linear", "order": 1, "numerator": [0.3, 0.1], "denominator": [0.7]}


def make_spec(core, effects=(), inputs=("u_V",), **further):
    frame = {
        "unit": "V",
        "peak": 1,
        "rate": 1,
        "force_unit": "um",
        "force": 1,
        "sense": -1,
        "dissipates": False,
    }
    scales = {"dt": DT, "input_peak": 2.0, "output_peak": 5.0, "fitted_s": 4.5, "duration_s": 6.0}
    return LocalExtendedSpec.model_validate(
        {
            "inputs": inputs,
            "output": "y_um",
            "core": core,
            "effects": [
                {"name": name, "parameters": {key: {"value": value} for key, value in values.items()}}
                for name, values in dict(effects).items()
            ],
            "scales": {**scales, "frame": {**frame, "sharp": 1}},
            **further,
        }
    )


def test_a_range_of_a_state_is_its_limits_in_a_program():
    equations = {
        "kind": "ode",
        "name": "valve",
        "input": "u",
        "output": "x",
        "equations": "dx/dt = u - x",
        "effects": {"state-range:x": {}},
    }
    limits = {"state-range:x lower": -1.0, "state-range:x upper": 2.0}
    (limit,) = collect_equations(make_spec(equations, {"state-range:x": limits})).limits.values()
    assert (limit.lower, limit.upper) == tuple(map(Symbol, limits))


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (make_spec({"kind": "second-order"}), "whose parameters c, k, m are estimated from a record"),
        (make_spec(SPRING, {"relaxation": {"relaxation": 0.1}}), "the effect relaxation cannot be written"),
        (make_spec(SPRING, {"state-clip:w": {"state-clip:w": 0.1}}), "the effect state-clip:w cannot be"),
        (make_spec(PIEZO, {"thermal-drift": {"k": 0.1}}), "the effect thermal-drift, since several channels"),
        (
            make_spec(PIEZO, {"cross-coupling": {"k": 0.1}}, ("u_V", "w_V", "z_m")),
            "the effect cross-coupling, since several channels",
        ),
        (
            make_spec(make_spec(PIEZO).model_dump(mode="json"), times=2),
            "whose input is interpolated twice cannot be written",
        ),
    ],
)
def test_effects_and_simulations_without_a_program_are_refused(spec, message):
    for kind in ("c", "matlab"):
        with pytest.raises(ModelError, match="take the format plain, python or json") as caught:
            export_extended(spec, kind)
        assert message in str(caught.value)


def test_a_native_or_recorded_simulation_is_refused_where_it_cannot_be_written():
    for kind in ("c", "matlab"):
        with pytest.raises(ModelError, match="the simulation fmu cannot be written in C or MATLAB"):
            export_extended(make_spec({"kind": "fmu", "file": "x.fmu"}), kind)
    with pytest.raises(ModelError, match="the simulation column has no closed form"):
        export_extended(make_spec({"kind": "column", "column": "x"}), "modelica")


def test_a_value_that_the_document_lacks_is_named():
    with pytest.raises(ModelError, match="effect jump has no value for instant: diagnose again"):
        collect_equations(make_spec(PIEZO, {"jump": {"c": 0.1, "when": 1.0}}))


def test_models_and_linear_simulations_are_exported_in_closed_form():
    assert "double predict(" in export_extended(make_spec(LINEAR), "c")
    assert "function y = narx_model(" in export_extended(
        make_spec({"kind": "model", "model": MODEL}), "matlab"
    )


@pytest.mark.parametrize("kind", EXTENDED_EXPORTS)
def test_every_format_of_an_extended_simulation_is_text(kind):
    assert export_extended(make_spec(PIEZO, {"offset": {"c": 0.5}}), kind).strip()


def test_states_start_as_in_the_diagnosed_record():
    found = collect_equations(make_spec(SPRING, start={"x": 0.25}))
    assert {name: each.value for name, each in found.start.items()} == {"x": 0.25, "v": 0.0}
    assert {name: each.unit for name, each in found.start.items()} == {"x": "um", "v": "um/s"}


def test_the_only_channel_is_the_one_that_an_effect_reads():
    found = collect_equations(make_spec(PIEZO, {"thermal-drift": {"k": 0.1}}, ("u_V", "case")))
    assert found.columns == {"u": "u_V", "case": "case"}
