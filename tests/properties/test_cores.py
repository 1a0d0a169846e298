"""Laws of every simulation that can be diagnosed: what it says is true; effects at rest do nothing in it."""

from pathlib import Path

import numpy as np
import pytest

from islands.discrepancy.calibration.preparation import count_fitted_samples, make_context, select_effects
from islands.discrepancy.interfaces.context import SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators import (
    bouc_wen_piezo,
    cascaded_tanks,
    intersample,
    linear,
    narx,
    python_function,
    recorded_output,
    rigid_axis,
    saved_extension,
    second_order,
)
from islands.discrepancy.simulators.extended import ExtendedSimulator
from support.simulated_records import made

#: By name, what each has to be; the held one is within the extension.
KINDS = {
    "bouc-wen-piezo": bouc_wen_piezo.BoucWenPiezoSimulator,
    "second-order": second_order.SecondOrderSimulator,
    "rigid-axis": rigid_axis.RigidAxisSimulator,
    "cascaded-tanks": cascaded_tanks.CascadedTanksSimulator,
    "linear": linear.LinearSimulator,
    "model": narx.NarxSimulator,
    "column": recorded_output.RecordedOutput,
    "python": python_function.PythonFunctionSimulator,
    "held": intersample.ResampledSimulator,
    "extended": saved_extension.SavedExtension,
}


@pytest.fixture(params=KINDS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def core(name: str) -> Simulator:
    found = made()[name].core
    return found.simulator if name == "held" else found


@pytest.fixture
def scene(name: str, core: Simulator) -> SimulationContext:
    record = made()[name].record
    return make_context(record, core, count_fitted_samples(record))


@pytest.fixture
def alone(core: Simulator, scene: SimulationContext) -> ExtendedSimulator:
    return ExtendedSimulator(core, (), scene)


def effects(core: Simulator, scene: SimulationContext) -> list[Effect]:
    """Return all that can enter: gains and parameters as well, where every parameter is trusted."""
    free = select_effects(core, scene, {})
    trusted = select_effects(core, scene, {each.name: 0.1 for each in core.parameters if not each.initial})
    return list({each.name: each for each in (*free, *trusted)}.values())


def test_every_core_is_here() -> None:
    modules = {path.stem for path in Path(intersample.__file__).parent.glob("*.py")}
    here = {kind.__module__.rpartition(".")[2] for kind in KINDS.values()}
    assert modules - {"__init__", "coordinates", "around", "extended"} == here


def test_it_is_what_it_says(name: str, core: Simulator) -> None:
    assert isinstance(core, KINDS[name])
    assert core.name
    assert set(core.sites) <= set(Site)
    assert isinstance(core.is_continuous_time, bool)


def test_a_simulation_has_a_value_for_every_sample(
    alone: ExtendedSimulator, scene: SimulationContext
) -> None:
    simulated = alone.simulate(alone.nominal)
    assert simulated.shape == scene.u.shape
    assert simulated.dtype == np.float64
    assert np.isfinite(simulated).all()


def test_the_same_input_gives_the_same_bits(
    name: str, alone: ExtendedSimulator, core: Simulator, scene: SimulationContext
) -> None:
    u = scene.u.copy()
    first = alone.simulate(alone.nominal)
    again = ExtendedSimulator(core, (), scene)
    assert np.array_equal(again.simulate(again.nominal), first)
    other = ExtendedSimulator(made()[name].core if name != "held" else core, (), scene)
    assert np.array_equal(other.simulate(other.nominal), first)
    assert np.array_equal(scene.u, u)


def test_nominal_values_are_within_bounds_and_can_move(alone: ExtendedSimulator) -> None:
    lower, upper = alone.bounds
    assert np.isfinite(alone.nominal).all()
    assert (lower <= alone.nominal).all()
    assert (alone.nominal <= upper).all()
    assert (lower < upper).all()
    assert (alone.scales > 0.0).all()


def test_every_parameter_changes_the_output(name: str, alone: ExtendedSimulator) -> None:
    at_rest = alone.simulate(alone.nominal)
    for place, parameter in enumerate(alone.parameters):
        values = alone.nominal
        values[place] += alone.scales[place]
        changed = alone.simulate(np.minimum(values, alone.bounds[1])) - at_rest
        assert np.isfinite(changed).all(), parameter
        assert np.max(np.abs(changed)) > 0.0, parameter


def test_names_are_unique(core: Simulator, scene: SimulationContext) -> None:
    names = [each.name for each in core.parameters]
    assert len(set(names)) == len(names)
    found = select_effects(core, scene, {})
    assert len({each.name for each in found}) == len(found)
    for effect in effects(core, scene):
        own = [each.name for each in effect.parameters(scene)]
        assert len(set(own)) == len(own), effect.name


def test_the_frame_has_scales(core: Simulator, scene: SimulationContext) -> None:
    frame = scene.force_coordinate
    assert min(frame.peak, frame.rate, frame.force, frame.friction_smoothing) > 0.0
    assert frame.unit
    assert frame.force_unit
    assert frame.sign in (-1.0, 1.0)
    assert frame.lower_bound == (0.0 if frame.is_dissipative else -np.inf)


def test_an_effect_at_rest_does_nothing(
    core: Simulator, alone: ExtendedSimulator, scene: SimulationContext
) -> None:
    at_rest = alone.simulate(alone.nominal)
    found = effects(core, scene)
    assert found
    for effect in found:
        extended = alone.with_effects([effect])
        assert np.array_equal(extended.simulate(extended.nominal), at_rest), effect.name


def test_an_effect_enters_where_the_core_lets_it(
    core: Simulator, alone: ExtendedSimulator, scene: SimulationContext
) -> None:
    """At the first point of its grid every one of them does something that is a number."""
    at_rest = alone.simulate(alone.nominal)
    residual = 0.01 * scene.output_peak * np.sin(2 * np.pi * 7.3 * scene.time)
    for effect in effects(core, scene):
        extended = alone.with_effects([effect])
        lower, upper = extended.bounds
        changes = []
        for point in effect.starting_points(scene, residual):
            values = extended.nominal
            values[extended.get_slice(effect)] = point
            assert (lower <= values).all(), effect.name
            assert (values <= upper).all(), effect.name
            changes.append(np.max(np.abs(extended.simulate(values) - at_rest)))
        assert np.isfinite(changes).any(), effect.name
        assert np.nanmax(changes) > 0.0, effect.name
