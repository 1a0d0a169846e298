"""Planned experiments with another input."""

import numpy as np
import pytest

from islands.effects.catalogue import CATALOGUE
from islands.simulators.extended import ExtendedSimulator
from support.planned import amplifier_experiment, wave


@pytest.mark.parametrize("samples", [0, 200])
def test_starting_points_belong_to_the_output_at_the_new_input(samples: int) -> None:
    """A cyclic error has its period over that output, which has another number of samples, too."""
    experiment = amplifier_experiment(wave((0.25,)))
    other = wave((0.4, 0.7))
    changed = experiment.with_input(np.append(other, other[:samples]))
    (channel,) = changed.channels
    output = ExtendedSimulator(channel.simulator, (), channel.context).simulate(
        np.array([each.nominal for each in channel.simulator.parameters])
    )
    pitch = float(np.ptp(output)) / 23.0
    points = CATALOGUE["cyclic-error"].starting_points(channel.context, np.sin(2 * np.pi * output / pitch))
    assert points[0][2] * pitch == pytest.approx(1.0, rel=0.03)
