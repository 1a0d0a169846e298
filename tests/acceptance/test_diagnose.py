"""The command diagnose: what it writes, what it says, what it refuses."""

import json
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from islands.discrepancy.detectability import NOTHING, SelfTest, SurrogateOutcome, self_test
from islands.discrepancy.diagnosis import Diagnosis
from islands.discrepancy.interfaces.parallel import ParallelMap
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.surrogates import SurrogateCase
from islands.io.records import write_record
from islands.performance.trials.injection.measurement import inject
from support.command_line import fail, succeed, write_offset
from support.undrawn import undrawn_figures

COLUMNS = ("--input", "u_V", "--output", "y_um", "--channel", "T_K", "--channel", "w_V")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record in which the sensor follows a temperature, and what is said of it; no figure is drawn."""
    base = tmp_path_factory.mktemp("diagnosis")
    hidden = inject(["thermal-drift"], np.random.default_rng(4), seconds=6.0, band=(1.0, 4.0))
    write_record(hidden.record, base / "piezo.csv")
    with undrawn_figures():
        succeed(
            *("diagnose", base / "piezo.csv", *COLUMNS, "--simulation", "bouc-wen-piezo"),
            *("--tolerance", "A=0.02", "--tolerance", "dp=0.01", "--out", base / "out"),
        )
    return base


def test_one_command_names_what_the_simulation_lacks(folder: Path) -> None:
    document = json.loads((folder / "out/discrepancy.json").read_text())
    assert document["verdict"] == "named"
    assert [effect["name"] for effect in document["effects"]] == ["thermal-drift"]
    effect = document["effects"][0]
    assert effect["parameters"]["k"]["unit"] == "um/K"
    low, high = effect["parameters"]["k"]["ci95"]
    assert low < effect["parameters"]["k"]["value"] < high
    assert document["gain"]["reduction_percent"] > 20
    assert document["gain"]["after"]["rmse"] < document["gain"]["before"]["rmse"]
    assert set(document["gain"]["noise_floor"]) == {"rmse", "mape"}
    assert document["candidates"][0]["name"] == "thermal-drift"
    assert document["wall_s"] > 0
    for name in ("detection_limits", "false_alarm_rate", "p_value", "confusion"):
        assert document[name] is None
    extended = json.loads((folder / "out" / document["extended_model"]).read_text())
    assert [each["name"] for each in extended["effects"]] == ["thermal-drift"]


def test_the_report_is_one_file_that_says_it_in_words(folder: Path) -> None:
    text = (folder / "out/report.html").read_text()
    assert "thermal-drift: k = " in text
    assert "which nothing else has\nseen" in text
    assert text.count("<img ") == 4
    assert not re.findall(r'(?:src|href)="(?!data:)', text)


@pytest.mark.ci
def test_the_figures_of_the_report_are_drawn(beside: Path) -> None:
    succeed(
        *("diagnose", beside / "record.csv", "--input", "u_V", "--output", "y_um"),
        *("--simulation", "column:theirs_um", "--out", beside / "drawn"),
    )
    drawn = re.findall(
        r'src="data:image/svg\+xml;base64,([^"]+)"', (beside / "drawn/report.html").read_text()
    )
    assert len(drawn) == 4
    assert min(map(len, drawn)) > 10_000


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short record with somebody else's simulation in a column, which lacks an offset."""
    base = tmp_path_factory.mktemp("self-test")
    write_offset(base / "record.csv")
    return base


def self_tested(base: Path, out: str, *options: object) -> tuple[str, dict]:
    """Diagnose with a self-test; return what was said, and the document."""
    with undrawn_figures():
        said = succeed(
            *("diagnose", base / "record.csv", "--input", "u_V", "--output", "y_um"),
            *("--simulation", "column:theirs_um", "--self-test", *options, "--out", base / out),
        )
    return said, json.loads((base / out / "discrepancy.json").read_text())


def answered(_analyse: object, probes: Sequence[SurrogateCase]) -> Iterator[SurrogateOutcome]:
    """Answer probes without an analysis: what is larger than a third of the noise is named."""
    for probe in probes:
        named = probe.injection is not None and probe.injection.misfit > 0.33
        yield SurrogateOutcome("offset" if named else NOTHING, named, 1.0)


def quick_self_test(
    found: Diagnosis, core: Simulator, tolerance: dict, seed: int, _run: ParallelMap, **asked: Any
) -> SelfTest:
    return self_test(found, core, tolerance, seed, answered, **asked)


@pytest.mark.parametrize(
    ("clean", "effects", "quick"),
    [
        pytest.param(40, None, True, id="answered"),
        pytest.param(4, ("offset",), False, id="small", marks=pytest.mark.ci),
        pytest.param(40, None, False, id="whole", marks=pytest.mark.nightly),
    ],
)
def test_a_self_test_says_what_the_record_could_show(
    beside: Path, clean: int, effects: tuple[str, ...] | None, quick: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    tested = partial(quick_self_test if quick else self_test, effects=effects, clean=clean)
    monkeypatch.setattr("islands_api.cli.commands.diagnose.self_test", tested)
    out = f"self-test-{clean}-{quick}"
    said, document = self_tested(beside, out, "--workers", 1)
    assert [effect["name"] for effect in document["effects"]] == ["offset"]
    limits = document["detection_limits"]
    assert set(effects or ("offset", "viscous", "jump", "sensor-lag")) <= set(limits)
    assert set(limits["offset"]) == {"strength", "unit", "misfit_sigma"}
    assert limits["offset"]["unit"] == "um"
    # An offset's misfit is the offset itself.
    assert limits["offset"]["strength"] == pytest.approx(0.1 * limits["offset"]["misfit_sigma"], rel=0.2)
    assert limits["offset"]["strength"] < document["effects"][0]["parameters"]["c"]["value"]
    alarms = document["false_alarm_rate"]
    assert alarms["of"] == clean
    assert alarms["ci95"][0] <= alarms["value"] <= alarms["ci95"][1]
    assert alarms["value"] < 0.2
    assert document["p_value"] == pytest.approx(1 / (clean + 1))
    assert sum(each["times"] for each in document["confusion"] if each["hidden"] == "nothing") == clean
    assert f"Of {clean} records like this one with nothing wrong in them" in said
    text = (beside / out / "report.html").read_text()
    assert "smallest strength that was named" in text
    assert re.search(r'<td class="name">offset</td><td>[\d.]+ um</td><td>[\d.]+ times the noise</td>', text)


@pytest.mark.nightly
def test_a_self_test_is_the_same_on_all_cores(beside: Path) -> None:
    (_, alone), (_, together) = (
        self_tested(beside, f"workers-{workers}", "--workers", workers) for workers in (1, 2)
    )
    for name in ("detection_limits", "false_alarm_rate", "p_value", "confusion"):
        assert together[name] == alone[name]


def test_a_result_is_not_written_over_unasked(folder: Path) -> None:
    asked = ("diagnose", folder / "piezo.csv", *COLUMNS, "--simulation", "bouc-wen-piezo")
    assert "holds a result already" in fail(*asked, "--out", folder / "out")


@pytest.mark.parametrize(
    ("options", "why"),
    [
        (("--simulation", "pendulum"), "unknown simulation 'pendulum': take one of bouc-wen-piezo"),
        (("--simulation", "bouc-wen-piezo:none.json"), "none.json cannot be read as JSON"),
        (("--simulation", "model:none.json"), "none.json"),
        (("--simulation", "column:y_sim"), "no column y_sim"),
        (("--simulation", "bouc-wen-piezo", "--tolerance", "dp"), "write PARAM=REL, for example dp=0.01"),
        (("--simulation", "bouc-wen-piezo", "--tolerance", "mass=0.1"), "has no parameter 'mass'"),
        (("--simulation", "bouc-wen-piezo", "--input", "T_K"), "is driven by one input"),
    ],
)
def test_an_impossible_diagnosis_is_refused_in_a_line(
    folder: Path, options: tuple[str, ...], why: str
) -> None:
    said = fail("diagnose", folder / "piezo.csv", *COLUMNS, *options, "--out", folder / "other")
    assert why in said
    assert "Traceback" not in said
    assert not (folder / "other").exists()
