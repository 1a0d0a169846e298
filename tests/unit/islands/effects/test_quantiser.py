"""Quantiser of the input: its levels, and the values that a record does not tell apart."""

import numpy as np
import pytest

from islands.effects.hysteresis import STICTION
from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Effect, apply_map
from islands.effects.quantiser import QUANTISED_INPUT

#: Part of an input in which a rounded value is between two levels.
RAMP = 0.05


def make_context(levels: int, seed: int, samples: int = 900) -> SimulationContext:
    """Return the context of a held input with this number of levels on average; two thirds are fitted."""
    rng = np.random.default_rng(seed)
    values = rng.uniform(-2.0, 2.0, 2 * levels)
    u = np.repeat(values, rng.integers(samples // levels // 2, 2 * samples // levels, values.size))[:samples]
    return SimulationContext(u, 0.1, {}, {}, 2.0, 2.0, "V", "V", samples * 0.1 * 2 / 3)


@pytest.mark.parametrize("offset", [0.0, 0.1, -0.3])
def test_levels_are_the_offset_and_multiples_of_the_step(offset: float) -> None:
    context, step = make_context(40, 0), 0.4
    moved = apply_map(QUANTISED_INPUT, context.u, np.array([step, offset]), context)
    places = (moved - offset) / step
    assert np.max(np.abs(moved - context.u)) <= step / 2
    assert np.mean(np.abs(places - np.round(places)) < 1e-9) > 1.0 - RAMP


def centre(effect: Effect, values: Signal, context: SimulationContext) -> Signal:
    assert effect.centre is not None
    return effect.centre(values, context)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("effect", "values"),
    [(QUANTISED_INPUT, (0.41, 0.0)), (QUANTISED_INPUT, (0.41, 0.13)), (STICTION, (0.7,))],
    ids=["step", "step and offset", "stiction"],
)
def test_values_in_the_middle_move_the_fitted_input_alike(
    effect: Effect, values: tuple[float, ...], seed: int
) -> None:
    context = make_context(25, seed)
    fitted = context.time < context.fit_end_time
    true = apply_map(effect, context.u, np.array(values), context)
    middle = centre(effect, np.array(values), context)
    moved = apply_map(effect, context.u, middle, context)
    # The levels themselves may differ: a gain and a level of the plant make up for that.
    changes, true_changes = np.diff(moved[fitted]), np.diff(true[fitted])
    assert np.array_equal(np.sign(changes.round(9)), np.sign(true_changes.round(9)))
    assert middle == pytest.approx(centre(effect, middle, context))
    assert middle == pytest.approx(values, abs=0.15)


def test_offset_is_zero_if_multiples_of_a_step_round_the_input_alike() -> None:
    context = make_context(25, 0)
    step, offset = centre(QUANTISED_INPUT, np.array([0.41, 0.003]), context)
    assert offset == 0.0
    assert step == pytest.approx(0.41, abs=0.01)
