"""Force laws as terms of equations: the expressions are those of the functions."""

from dataclasses import replace

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect, ForceLaw
from islands.expressions.evaluation import evaluate
from islands.expressions.parsing import parse_expression
from islands.simulators.extended import ExtendedSimulator, make_context
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec
from support.simulated_records import recorded, wave

LAWS = [
    (effect.name, effect.form)
    for effect in CATALOGUE.values()
    if isinstance(effect.form, ForceLaw) and effect.form.equation
]


def as_function(effect: Effect) -> Effect:
    """Return an effect whose force law is only a function."""
    assert isinstance(effect.form, ForceLaw)
    return replace(effect, form=replace(effect.form, equation="", state_equation=""))


@pytest.mark.parametrize(("name", "law"), LAWS)
def test_expression_of_a_force_law_has_the_values_of_its_function(name: str, law: ForceLaw) -> None:
    pairs = [(law.equation, law.force), (law.state_equation, law.state_derivative)]
    for row in np.random.default_rng(1).normal(size=(20, 11)):
        x, v, z, *numbers = row.tolist()
        values = {"x": x, "v": v, "z": z, **{f"n{index}": each for index, each in enumerate(numbers)}}
        for text, function in pairs:
            if function is not None:
                expected = function(x, v, z, np.array(numbers))
                found = evaluate(parse_expression(text), values)
                assert found == pytest.approx(expected, rel=1e-12, abs=1e-12), name


@pytest.mark.ci
def test_simulation_with_expressions_is_that_with_functions() -> None:
    u = wave(300)
    record = recorded(u, u / 200.0)
    spring = PhysicalSpec(kind="second-order", parameters={"m": 0.5, "c": 4.0, "k": 200.0})
    core = make_simulator(spring, record)
    context = make_context(record, core, 225)
    effects = [CATALOGUE["cubic-stiffness"], CATALOGUE["second-hysteresis"]]
    # Both kinds in one equation: a law that is only a function stays a call.
    outputs = []
    for chosen in (effects, list(map(as_function, effects)), [effects[0], as_function(effects[1])]):
        simulation = ExtendedSimulator(core, tuple(chosen), context)
        values = simulation.nominal
        for effect in chosen:
            point = effect.starting_points(context, u)[-1]
            values[simulation.get_slice(effect)] = 5.0 * np.array(point)
        outputs.append(simulation.simulate(values))
    without = ExtendedSimulator(core, (), context)
    assert np.std(outputs[0] - without.simulate(without.nominal)) > 1e-3 * np.std(outputs[0])
    for other in outputs[1:]:
        np.testing.assert_allclose(other, outputs[0], rtol=1e-9, atol=1e-12 * np.max(np.abs(outputs[0])))
