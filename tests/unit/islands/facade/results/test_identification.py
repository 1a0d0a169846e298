"""Result of a search: the recommended model and the folder."""

import json

import numpy as np
import pandas as pd
import pytest

import islands
from support.searches import record
from support.undrawn import undrawn_figures


@pytest.mark.ci
def test_a_result_without_a_loop_replaces_the_loop_figure_of_an_earlier_one(result, tmp_path):
    figures = tmp_path / "figures"
    figures.mkdir()
    (figures / "loop.svg").touch()
    with undrawn_figures():
        result.save(tmp_path, figures=("free-run", "loop", "front"))
    assert {path.name for path in figures.iterdir()} == {"free-run.svg", "front.svg"}
    assert json.loads((tmp_path / "result.json").read_text())["loop"] is False


def test_predictions_of_a_frame_have_one_value_per_row(result):
    data = record(200)
    frame = pd.DataFrame({"u": data.u[:, 0], "y": data.y})
    predicted = result.predict(frame)
    assert predicted.shape == (200,)
    lag = result.best.model.maximum_lag
    assert np.array_equal(predicted, result.best.simulate(data, warm_up=lag).y, equal_nan=True)
    # The free run reads only the first samples of the output.
    frame.loc[lag:, "y"] = np.nan
    assert np.array_equal(result.predict(frame), predicted, equal_nan=True)
    assert np.array_equal(result.predict(data.u, data.y, data.dt), predicted, equal_nan=True)
    # Without an output, the model starts from rest, and every sample is predicted.
    inputs = frame[["u"]]
    assert np.array_equal(result.predict(inputs), result.simulate(inputs).y)
    with pytest.raises(islands.RecordError, match="no column u; it has v, y"):
        result.predict(frame.rename(columns={"u": "v"}))


def test_recordings_of_a_list_are_predicted_one_after_the_other(result):
    parts = [record(60, seed=seed) for seed in (1, 2)]
    frames = [pd.DataFrame({"u": part.u[:, 0], "y": part.y}) for part in parts]
    expected = np.concatenate([result.predict(part) for part in parts])
    assert np.array_equal(result.predict(frames), expected, equal_nan=True)
    assert np.array_equal(
        result.best.simulate(frames).y, result.best.simulate(islands.join(tuple(parts))).y, equal_nan=True
    )


def test_a_result_draws_its_recommended_model(result):
    assert result.plot()._repr_html_() == result.best.plot()._repr_html_()


@pytest.mark.parametrize("kind", ["free-run", "loop"])
def test_a_figure_is_drawn_into_the_axes_of_the_user(result, kind):
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.best.plot(kind, ax=right) is figure
    assert not left.has_data()
    assert {text.get_text() for text in right.get_legend().get_texts()} == {"measured", "simulated"}


def test_a_figure_of_several_panels_does_not_fit_into_one_axes(result):
    from matplotlib.figure import Figure

    with pytest.raises(islands.SettingsError, match="several panels"):
        result.best.plot("residuals", ax=Figure().subplots())


def test_a_model_is_exported_as_text_or_to_a_file(result, tmp_path):
    assert "double" in result.best.export("c")
    assert result.best.export("json", tmp_path / "model.json") is None
    assert islands.read_model(tmp_path / "model.json") == result.best.model
    with pytest.raises(islands.SettingsError, match="not text"):
        result.best.export("fmu")
