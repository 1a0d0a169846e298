"""Progress of an identification: honest about the time left over recorded runs, in every phase."""

import numpy as np
import pytest

import islands
from islands.evolution.presets import AUTO
from islands.evolution.settings import Settings
from islands.facade.identification_progress import class_phases, fit_phases, identification_phases
from islands.progress import PhasedProgress
from support.latent_systems import spring_record
from support.recorded_runs import find_quarters, find_standstills, late, replay

#: Recorded runs with the largest error of the time left beyond half of it, in seconds, as measured.
EXCESS = {
    "identification-500": 1.0,
    "identification-2000": 1.0,
    "identification-20000": 3.0,
    "identification-narx": 1.0,
    "outputs": 3.0,
}


@pytest.mark.parametrize("name", EXCESS)
def test_time_left_is_within_half_of_the_truth_and_some_seconds(name):
    shown = [each for each in late(replay(name)) if each.left is not None]
    assert len(shown) > 120
    assert all(abs(each.left - each.truth) <= 0.5 * each.truth + EXCESS[name] for each in shown)


@pytest.mark.parametrize("name", EXCESS)
def test_bar_moves_from_the_first_phase_on_and_never_back(name):
    moments = replay(name)
    fractions = [each.fraction for each in moments]
    assert fractions == sorted(fractions)
    quarters = find_quarters(moments)
    assert 0.0 < quarters[0] < quarters[1] < quarters[2] <= quarters[3] <= 1.0


@pytest.mark.parametrize("name", EXCESS)
def test_time_left_is_never_constant_while_time_passes(name):
    assert not find_standstills(replay(name))


@pytest.mark.parametrize(
    "phases", [identification_phases("narx", 1000, Settings(), ("a", "b")), fit_phases(AUTO, ("a", "b"))]
)
def test_several_outputs_pass_the_same_phases_one_after_the_other(phases):
    seen = []
    progress = PhasedProgress(lambda _, fraction=None: seen.append(fraction), phases)
    for message in (
        "a: best subsets of",
        "a: estimation of the final models",
        "b: best subsets of",
        "b: estimation of the final models",
        "choice of the equations",
    ):
        progress(message)
    assert seen == sorted(seen)
    assert 0.2 < seen[-2] < seen[-1] < 1.0


@pytest.mark.nightly
def test_a_fit_of_latent_models_reports_their_generations():
    reported = []
    progress = PhasedProgress(lambda *each: reported.append(each), class_phases("latent", 240))
    islands.fit(spring_record(240, noise=0.02), model="latent", progress=progress)
    messages, fractions = zip(*reported, strict=True)
    generations = [each for each in messages if each.startswith("search: generation")]
    assert generations[0] == "search: generation 0 of 10"
    assert generations[-1] == "search: generation 10 of 10"
    assert list(fractions) == sorted(fractions)
    steps = np.diff([fraction for message, fraction in reported if message in generations])
    assert 0.2 < sum(steps) < 1.0
    assert max(steps) < 0.35
