"""Artefact with the outputs of a diagnosis: a part of it is that of the signals."""

from pathlib import Path

import numpy as np
import pytest

from islands.errors import SettingsError
from islands_service.domain.plot_envelopes import describe_outputs, write_outputs

MEASURED = np.array([1.0, np.nan, 3.0, 5.0])


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "outputs.npy"
    file.write_bytes(write_outputs(MEASURED, {"simulated": np.ones(4), "extended": np.arange(4.0)}))
    return file


def test_a_residual_is_the_measured_less_the_simulated_output(path: Path) -> None:
    found = describe_outputs(path, 0, None, 10)
    assert (found["start"], found["stop"], found["rows"]) == (0, 4, [0, 1, 2, 3])
    values = {each["name"]: each["minimum"] for each in found["residuals"]}
    assert values == {"simulated": [0.0, None, 2.0, 4.0], "extended": [1.0, None, 1.0, 2.0]}


@pytest.mark.parametrize(("start", "stop"), [(4, None), (3, 2)])
def test_samples_that_do_not_exist_are_refused(path: Path, start: int, stop: int | None) -> None:
    with pytest.raises(SettingsError, match=r"has samples 0 to 3, and .* is not a part of it"):
        describe_outputs(path, start, stop, 10)
