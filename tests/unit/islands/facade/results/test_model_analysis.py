"""Analyses of the models of a result: equation, linear system, characteristic, step response."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.expressions.parsing import parse
from islands.facade.results.model_analysis import split_point
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel
from islands.models.narx import make_model
from support.block_cases import OF_BLOCKS


@pytest.mark.ci
def test_a_response_is_drawn_into_the_axes_of_the_user(result):
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.best.plot_step_response(0.0, 1.0, ax=left) is figure
    assert result.best.plot_static_characteristic([0.0, 1.0], ax=right) is figure
    assert right.get_lines()[0].get_ydata() == pytest.approx(result.best.static_characteristic([0.0, 1.0]))


def test_the_members_of_a_linear_system_are_those_of_the_ensemble(result, tmp_path):
    system = result.linearise()
    structures = result.search_result.ensemble.structures
    assert len(system.members) == sum(len(each.parameters) for each in structures)
    assert sum(system.weights) == pytest.approx(1.0)
    low, high = system.frequency_response([0.1]).band()
    assert (low <= high).all()
    result.save(tmp_path, figures=())
    # A model file alone has the same uncertainty, and the same operating point.
    file = shutil.copy(tmp_path / "models" / f"{result.best.rank:02d}.json", tmp_path.parent / "alone.json")
    for again in (islands.load(tmp_path).linearise(), islands.load(file).linearise()):
        assert again.A.tobytes() == system.A.tobytes()
        assert [each.A.tobytes() for each in again.members] == [each.A.tobytes() for each in system.members]
        assert again.operating_inputs == system.operating_inputs


def test_an_operating_point_has_the_level_of_every_output_or_of_none():
    model = CoupledModel(
        (
            make_model([(parse("y(k-1)"), 0.5)], ("u", "b"), "a"),
            make_model([(parse("u1(k-1)"), 0.5)], ("u", "a"), "b"),
        )
    )
    assert split_point(model, {}) == (None, None)
    assert split_point(model, {"b": 1.0, "u": 2.0, "a": 3.0}) == ({"u": 2.0}, [3.0, 1.0])
    with pytest.raises(islands.ModelError, match="the level of each, or of none"):
        split_point(model, {"a": 1.0})


def test_outputs_that_read_inputs_at_once_are_simulated_from_inputs_alone():
    one = OF_BLOCKS["state space at once"]
    both = CoupledLatentModel((one, replace(one, output_name="z_mm")))
    u = np.random.default_rng(0).normal(size=(40, 2))
    single, joint = (islands.FittedModel.from_model(each) for each in (one, both))
    expected = np.column_stack([single.simulate(u).y] * 2)
    for given in (u, {"u_V": u[:, 0], "v_V": u[:, 1]}):
        np.testing.assert_allclose(joint.simulate(given).y, expected, rtol=1e-13)


def test_inputs_alone_are_simulated_from_rest_as_an_array_a_frame_and_step_by_step(result):
    u = 0.4 + 0.1 * np.sin(np.arange(30) / 4.0)
    simulated = result.simulate(u).y
    assert result.simulate({"u": u}).y.tobytes() == simulated.tobytes()
    twice = result.simulate([{"u": u}, {"u": u}]).y
    assert twice.tobytes() == np.tile(simulated, 2).tobytes()
    stepper = result.stepper(u[0])
    assert np.array([stepper.step(each) for each in u]).tobytes() == simulated.tobytes()
    with pytest.raises(islands.RecordError, match="sampling time"):
        result.simulate({"time": 7.7 * np.arange(30), "u": u})
