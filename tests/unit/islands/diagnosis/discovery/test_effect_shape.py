"""Shape of a named effect: the curve of the effect agrees with the free curve that the record shows."""

import numpy as np
import pytest

from islands.diagnosis.procedure import diagnose
from islands.diagnosis.result import Diagnosis
from islands.effects.catalogue import CATALOGUE
from islands.report.figures.diagnosis import draw_effect_shape
from lab.diagnosis.cases import CASES
from lab.diagnosis.injection.measurement import inject

#: Effects that are searched for: the free curves, both faults and a cause of another kind.
EFFECTS = tuple(
    CATALOGUE[name]
    for name in ("cubic-stiffness", "coulomb-friction", "stiffness-curve", "damping-curve", "offset")
)


def diagnose_fault(name: str, seed: int) -> Diagnosis:
    case = CASES["second-order"]
    faulty = inject(
        [name],
        np.random.default_rng(seed),
        *(None, "white", (1.0, 4.0), False, case.system, case.perturbed, case.free),
    )
    return diagnose(faulty.record, case.make(faulty), case.tolerance, seed, catalogue=EFFECTS)


@pytest.mark.nightly
def test_curve_of_a_cubic_spring_is_within_the_band_of_the_free_curve() -> None:
    shape = diagnose_fault("cubic-stiffness", 2).shape
    assert shape is not None
    assert (shape.name, shape.form, shape.signal) == ("cubic-stiffness", "stiffness-curve", "coordinate")
    named = np.interp(shape.free_places, shape.places, shape.named)
    assert np.all(np.abs(shape.free - named) < 2.0 * shape.half_widths)
    assert np.ptp(named) > 10.0 * np.max(shape.half_widths)
    assert len(draw_effect_shape(shape).axes) == 1


@pytest.mark.nightly
def test_smooth_curve_is_not_shown_for_a_step() -> None:
    found = diagnose_fault("coulomb-friction", 3)
    assert [each.name for each in found.effects] == ["coulomb-friction"]
    assert found.shape is None
