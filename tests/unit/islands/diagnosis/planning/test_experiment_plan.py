"""Plan of an experiment: noise, pairs, limits, and impossible settings."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.diagnosis.inference import noise_floor
from islands.diagnosis.planning import decisive_experiment
from islands.diagnosis.planning.experiment_plan import ExperimentPlan
from islands.effects.catalogue import CATALOGUE
from islands.errors import RecordError, SettingsError
from islands.report.documents.diagnosis_json import as_json
from islands.report.documents.plan_json import plan_document
from islands.report.figures.separability import draw_separability
from islands.report.text.plan import plan_text
from islands.simulators.external import RecordedOutput
from support.planned import DT, amplifier, input_record, take_effects, wave

EFFECTS = tuple(take_effects("delay", "sensor-lag", "offset", "sensor-gain"))


@pytest.fixture(scope="module", autouse=True)
def _short_optimisation() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decisive_experiment, "GENERATIONS", 1)
        patch.setattr(decisive_experiment, "_POPULATION", 2)
        patch.setattr(noise_floor, "RANDOM_FEATURES", 20)
        yield


@pytest.fixture(scope="module")
def plan() -> ExperimentPlan:
    """Plan with an input that separates neither delay and lag nor shows a wrong gain."""
    return islands.plan_experiment(
        input_record(wave((0.25,))), amplifier(), noise_std=0.2, effects=EFFECTS, amplitude=2.0, rate=60.0
    )


@pytest.mark.ci
def test_the_decisive_experiment_is_for_inseparable_pairs(
    plan: ExperimentPlan,
) -> None:
    assert plan.decisive is not None
    assert [pair.names for pair in plan.decisive.pairs] == [("delay", "sensor-lag")]
    assert np.max(np.abs(plan.decisive.u)) <= 2.0 * (1 + 1e-9)
    assert np.max(np.abs(np.diff(plan.decisive.u))) <= 60.0 * DT * (1 + 1e-9)
    assert plan.record.y[100] == pytest.approx(2.0 * plan.record.u[100, 0])


def test_the_document_and_the_text_have_the_same_answers(plan: ExperimentPlan) -> None:
    document = plan_document(plan)
    assert as_json(document).startswith("{")
    causes = {each["name"]: each for each in document["causes"]}
    assert set(causes) == {"delay", "sensor-lag", "offset"}
    delay, lag, offset = plan.isolability.rows
    assert document["separable_from_misfit"][0][2] == delay.misfits[2]
    assert delay.misfits[1] > 1.0 > delay.misfits[2]
    text = plan_text(plan)
    assert "Decisive experiment: " in text
    assert max(map(len, text.splitlines())) <= 100
    rows = [line for line in text.splitlines() if line.startswith(" 1 delay")]
    assert rows[0].split()[2:] == ["x" if np.isfinite(delay.misfits[1]) else "#", "."]
    assert lag.detectable is not None
    assert offset.detectable is not None


def test_a_sufficient_input_needs_no_decisive_experiment() -> None:
    found = islands.plan_experiment(
        input_record(wave((0.5, 3.0))), amplifier(), noise_std=0.1, effects=take_effects("offset", "backlash")
    )
    assert found.decisive is None
    assert "this input is sufficient" in plan_text(found)


def test_the_figure_has_a_row_and_a_column_for_each_cause(plan: ExperimentPlan) -> None:
    axes = draw_separability(plan.isolability, "a title").axes[0]
    rows, columns = axes.get_yticklabels(), axes.get_xticklabels()
    assert [text.get_text() for text in rows] == [text.get_text() for text in columns]
    assert [text.get_text() for text in rows] == list(plan.isolability.names)


def test_impossible_plans_are_refused() -> None:
    record = input_record(wave((0.25,)))
    refused = (
        ("give its standard deviation", RecordError, {}),
        ("positive number", SettingsError, {"noise_std": 0.0}),
        ("two different causes", SettingsError, {"noise_std": 0.1, "separate": ("delay",)}),
        ("unknown cause", SettingsError, {"noise_std": 0.1, "separate": ("delay", "friction")}),
    )
    for message, error, settings in refused:
        with pytest.raises(error, match=message):
            islands.plan_experiment(record, amplifier(), effects=EFFECTS, **settings)
    with pytest.raises(RecordError, match="at least 200"):
        islands.plan_experiment(record[:150], amplifier(), noise_std=0.1)
    with pytest.raises(RecordError, match="one recording"):
        islands.plan_experiment(islands.join((record, record)), amplifier(), noise_std=0.1)
    with pytest.raises(SettingsError, match="recorded column"):
        islands.plan_experiment(record, RecordedOutput("theirs", record.u[:, 0]), noise_std=0.1)


def test_a_pair_with_an_absorbed_cause_is_refused() -> None:
    record, name = input_record(wave((0.25,))), "mute"
    mute = replace(CATALOGUE["offset"], name=name, form=lambda y, _values, _context: 1.0 * y)
    with pytest.raises(SettingsError, match="not detectable with this input"):
        islands.plan_experiment(
            *(record, amplifier()),
            noise_std=0.1,
            effects=[CATALOGUE["offset"], mute],
            separate=("offset", name),
        )
