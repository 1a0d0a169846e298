"""Linearisations of models of every class."""

import numpy as np
import pytest

import islands
from islands.models.linearisation import linearise_block
from islands.models.measured_signals import measured_block
from islands.simulation.stepper import Stepper, measure_offsets
from support.block_cases import OF_BLOCKS, mark_slow

#: Models that are linear, so that their linear system is the model.
LINEAR = ("two masses", "coupled deviations", "integrator")

#: Models without an equilibrium at the inputs of their start, or with a kink there.
_WITHOUT = ("published 12", "three outputs")

SMOOTH = mark_slow(name for name in OF_BLOCKS if name not in (*_WITHOUT, "no output"))

TANK = islands.make_model(
    (islands.parse(term), number)
    for term, number in {"y(k-1)": 0.95, "u(k-1)": 0.2, "u(k-3)": 0.1, "y(k-1)*y(k-2)": -0.02}.items()
)

HYSTERESIS = islands.make_model(
    [
        (islands.parse("y(k-1)"), 1.0),
        (islands.parse("y(k-1)*sign(u(k-1) - u(k-2))*(u(k-1) - u(k-2))"), -0.1),
    ]
)


def deviate(name, size):
    """Largest difference of a model and its linear system after a motion of a size about the rest."""
    model = OF_BLOCKS[name]
    system = model.linearise()
    wave = size * np.random.default_rng(0).standard_normal((60, len(system.input_names)))
    u0, y0 = np.array(system.operating_inputs), np.array(system.operating_outputs)
    # An integrator rests at no other input.
    states = np.zeros(2) if name == "integrator" else None
    y = Stepper(model, u0, states=states).run(u0 + wave)
    expanded = system.expand_delays()
    x, linear = np.zeros(expanded.order), np.empty_like(y)
    for k, u in enumerate(wave + (u0 if states is not None else 0.0)):
        linear[k] = expanded.C @ x + expanded.D @ u
        x = expanded.A @ x + expanded.B @ u
    return np.abs(y - y0 - linear).max()


@pytest.mark.parametrize("name", LINEAR)
def test_the_linear_system_of_a_linear_model_is_the_model(name):
    assert deviate(name, 1.0) <= 1e-11


@pytest.mark.parametrize("name", SMOOTH)
def test_the_error_of_a_linear_system_is_of_second_order(name):
    large, small = deviate(name, 1e-3), deviate(name, 1e-4)
    assert small <= 0.02 * large + 1e-11


@pytest.mark.parametrize("name", [name for name, model in OF_BLOCKS.items() if model.kind == "latent"])
def test_a_state_space_is_its_own_observer_form(name):
    own, made = OF_BLOCKS[name].linearise(), linearise_block(measured_block(OF_BLOCKS[name]))
    for matrix in "ABCD" if own.dead_times == made.dead_times else "":
        assert getattr(made, matrix) == pytest.approx(getattr(own, matrix), rel=1e-12, abs=1e-15)
    # A state space reads its inputs at several samples of a dead time; the observer form has further states.
    assert made.step_response(50).values == pytest.approx(own.step_response(50).values, rel=1e-12, abs=1e-15)
    assert made.operating_outputs == pytest.approx(own.operating_outputs)


def test_a_late_input_is_a_dead_time():
    late = islands.make_model([(islands.parse("y(k-1)"), 0.5), (islands.parse("u(k-8)"), 2.0)], dt=0.5)
    system = late.linearise(1.0)
    assert (system.order, system.dead_times) == (1, (3.5,))
    assert system.poles == pytest.approx([0.5])
    assert system.operating_outputs == pytest.approx((4.0,))


def test_an_input_that_acts_at_once_passes_directly():
    system = islands.make_model(
        [(islands.parse("y(k-1)"), 0.5), (islands.parse("u(k-1)"), 2.0)], ("u_V+1",)
    ).linearise(1.0)
    assert (system.D.tolist(), system.B.tolist(), system.input_units) == ([[2.0]], [[1.0]], ("V",))


@pytest.mark.ci
def test_offsets_move_the_operating_point_alone():
    plain, moved = OF_BLOCKS["many parts"], OF_BLOCKS["deviations"]
    outputs, inputs = measure_offsets(moved)
    first, second = plain.linearise([0.1]), moved.linearise(0.1 + inputs)
    assert pytest.approx(first.A) == second.A
    assert second.operating_outputs == pytest.approx(np.array(first.operating_outputs) + outputs)


def test_an_operating_point_by_name_leaves_others_at_the_start():
    model = OF_BLOCKS["state space at once"]
    assert model.linearise({"v_V": 0.7}).operating_inputs == (0.2, 0.7)
    with pytest.raises(islands.ModelError, match="no input w; it has u_V, v_V"):
        model.linearise({"w": 1.0})


def test_a_kink_has_no_linearisation():
    with pytest.raises(islands.ModelError, match=r"the term y\(k-1\)\*sign\(.* has a kink"):
        HYSTERESIS.linearise(0.4, y=1.0)
    with pytest.raises(islands.ModelError, match=r"the model has 1 inputs \(u\), got"):
        TANK.linearise([0.4, 0.5])


def test_an_unstable_point_is_linearised_where_its_output_is_given():
    terms = [(islands.parse("y(k-1)"), 1.5), (islands.parse("u(k-1)"), 1.0)]
    system = islands.make_model(terms).linearise(0.0, y=0.0)
    assert system.poles == pytest.approx([1.5])
    assert not system.is_stable
    assert TANK.linearise(0.5).is_stable
