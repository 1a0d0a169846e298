"""A class of models that is added by its file and one entry passes fit, files, bands, exports, diagnosis."""

import numpy as np
import pytest

import islands
from islands.effects.catalogue import CATALOGUE
from islands.errors import ModelError
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import parse_spec
from support.command_line import succeed
from support.equation_programs import OCTAVE, extend, run_c, run_matlab
from support.gain_scheduled import TRUE, GainScheduledModel, add_class, make_record
from support.undrawn import undrawn_figures

pytestmark = pytest.mark.usefixtures("toy_class")


@pytest.fixture(scope="module")
def record():
    return make_record()


@pytest.fixture(scope="module")
def result(record):
    with pytest.MonkeyPatch.context() as patch:
        add_class(patch)
        return islands.fit(record, model="gain-scheduled")


def model_of(record) -> GainScheduledModel:
    return GainScheduledModel.of_record(record, TRUE)


def test_a_fit_finds_the_parameters_with_their_standard_errors(result):
    model = result.best.model
    deviations = (np.array(model.parameters) - TRUE) / np.array(model.standard_errors)
    assert np.abs(deviations).max() < 4.0
    assert result.best.metrics["validation"]["free_run"].rmse == pytest.approx(0.01, rel=0.2)


def test_a_saved_result_simulates_a_record_to_the_last_bit(result, record, tmp_path):
    with undrawn_figures():
        result.save(tmp_path)
    found = islands.load(tmp_path)
    assert found.best.model == result.best.model
    np.testing.assert_array_equal(found.simulate(record).y, result.best.simulate(record).y)
    band, expected = found.best.bands(record), result.best.bands(record)
    np.testing.assert_array_equal(band.upper, expected.upper)
    assert islands.load(tmp_path / "models/01.json").model == result.best.model
    assert "pole = 0.9" in (tmp_path / "summary.txt").read_text()


def test_a_band_contains_new_samples_with_its_probability(result):
    fresh = make_record(2000, seed=7)
    band = result.best.bands(fresh, 0.9)
    known = ~np.isnan(band.y)
    inside = (band.lower <= fresh.y) & (fresh.y <= band.upper)
    assert 0.85 <= inside[known].mean() <= 0.95


def test_a_damaged_file_names_the_class(record, tmp_path):
    file = tmp_path / "model.json"
    islands.write_model(model_of(record), file)
    file.write_text(file.read_text().replace('"slope"', '"tilt"'))
    with pytest.raises(ModelError, match=r"is not a model gain-scheduled.*slope"):
        islands.read_model(file)


def test_the_command_fits_a_class(record, tmp_path):
    islands.write_record(record, tmp_path / "oven.csv")
    folder, columns = tmp_path / "out", ("--input", "u_V", "--output", "y_K")
    with undrawn_figures():
        text = succeed("fit", tmp_path / "oven.csv", *columns, "--model", "gain-scheduled", "--out", folder)
    assert "slope = -0." in text
    assert "RMSE 0.0" in succeed("simulate", folder, tmp_path / "oven.csv")
    assert "x1(k)" in succeed("show", folder)


@pytest.mark.nightly
@pytest.mark.parametrize("disturbance", [0.0, 0.2])
def test_a_diagnosis_finds_a_disturbance_and_nothing_else(record, tmp_path, disturbance):
    islands.write_model(model_of(record), tmp_path / "model.json")
    measured = make_record(disturbance=disturbance, seed=3)
    found = islands.diagnose(measured, f"model:{tmp_path / 'model.json'}")
    assert [effect["name"] for effect in found.document["effects"]] == (
        ["periodic-disturbance"] if disturbance else []
    )
    if disturbance:
        found.save(tmp_path / "diagnosis")
        saved = islands.load(tmp_path / "diagnosis")
        extended = saved.simulate(measured).y
        assert np.sqrt(np.mean((extended - measured.y) ** 2)) == pytest.approx(0.01, rel=0.1)


def test_the_programs_of_an_extended_simulation_have_its_numbers(record, tmp_path):
    islands.write_model(model_of(record), tmp_path / "model.json")
    simulator = make_simulator(parse_spec(f"model:{tmp_path / 'model.json'}"), record, {})
    spec, expected = extend(simulator, record, [CATALOGUE["periodic-disturbance"]])
    np.testing.assert_allclose(run_c(spec, record, tmp_path), expected, rtol=1e-9)
    if OCTAVE is not None:
        (found,) = run_matlab([(spec, record)], tmp_path)
        np.testing.assert_allclose(found, expected, rtol=1e-9)
