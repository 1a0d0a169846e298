"""``islands diagnose --plan``: inputs, files of the result, and refused options."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from islands.cli.runs.plan import parse_excitation
from islands.diagnosis.planning import decisive_experiment, experiment_setup
from islands.diagnosis.planning.planned_input import InputForm
from islands.errors import SettingsError
from islands.records.reading import read_record
from islands.records.writer import write_input
from support.planned import DT, take_effects, wave

COMMAND = ("diagnose", "--plan", "--input", "u_V", "--out", "plan", "--workers", 1)

#: A static amplifier.
AMPLIFIER = "def amplify(u, dt, k=2.0):\n    return k * u\n"

CommandLine = Callable[..., tuple[int, str, str]]


@pytest.fixture
def _few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    effects = take_effects("delay", "sensor-lag")
    monkeypatch.setattr(experiment_setup, "select_effects", lambda *_: list(effects))
    monkeypatch.setattr(decisive_experiment, "GENERATIONS", 1)


@pytest.mark.ci
@pytest.mark.usefixtures("_few_effects")
def test_a_plan_of_an_input_file_writes_the_decisive_input(command_line: CommandLine, tmp_path: Path) -> None:
    (tmp_path / "amplifier.py").write_text(AMPLIFIER)
    write_input(wave((0.25,)), DT, "u_V", tmp_path / "input.csv")
    options = ("--simulation", "python:amplifier.py:amplify", "--set", "noise_std=0.2", "--set", "rate=40")
    code, printed, _ = command_line(*COMMAND, "input.csv", *options, "--set", "separate=delay,sensor-lag")
    assert code == 0
    assert "delay or sensor-lag at 1 sigma" in printed
    document = json.loads((tmp_path / "plan/plan.json").read_text())
    assert document["noise_std"] == 0.2
    assert document["alternatives"][0]["cost"] == "none"
    assert (tmp_path / "plan/plan.svg").read_text().startswith("<?xml")
    planned = read_record(tmp_path / "plan/experiment.csv", ["u_V"], None)
    assert planned.samples == 400
    assert planned.dt == pytest.approx(DT)
    assert planned.input_units == ("V",)
    assert np.max(np.abs(np.diff(planned.u[:, 0]))) / DT <= 40 * (1 + 1e-6)
    code, _, error = command_line(*COMMAND, "input.csv", *options)
    assert code == 2
    assert "holds a result already" in error


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--plan", "--set", "noise_std=1"), "a plan needs one input"),
        (
            ("--plan", "--set", "excitation=sine:1", "--set", "amplitude=1"),
            "also needs the settings amplitude and duration, and --dt",
        ),
        (("--set", "noise_std=1"), "noise_std is a setting of plans: add --plan"),
        ((), "needs a record and --output"),
    ],
)
def test_incomplete_options_are_refused(
    command_line: CommandLine, options: tuple[object, ...], message: str
) -> None:
    code, _, error = command_line(
        *("diagnose", "--input", "u_V", "--out", "plan", "--simulation", "linear:0"), *options
    )
    assert code == 2
    assert message in error


def test_a_described_input_has_its_form_and_numbers() -> None:
    multisine, steps = parse_excitation("multisine:0.1:5"), parse_excitation("steps:0.5")
    assert (multisine.form, multisine.lowest, multisine.frequency) == (InputForm.MULTISINE, 0.1, 5.0)
    assert (steps.form, steps.frequency) == (InputForm.STEPS, 2.0)
    for text in ("sine", "sine:-1", "multisine:1", "steps:a"):
        with pytest.raises(SettingsError, match="write multisine:LOW:HIGH"):
            parse_excitation(text)
    with pytest.raises(SettingsError, match="unknown excitation"):
        parse_excitation("chirp:1")
