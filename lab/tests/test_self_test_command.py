"""``islands diagnose --self-test``: detection limits and false alarms in the document and the report."""

import json
import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from islands.diagnosis.detectability import NOTHING, SelfTest
from islands.diagnosis.result import Diagnosis
from islands.parallel import ParallelMap
from islands.simulators.interface import Simulator
from lab.diagnosis.self_test import SurrogateOutcome, self_test
from lab.diagnosis.surrogates import SurrogateCase
from support.command_line import succeed, write_offset
from support.undrawn import undrawn_figures


@pytest.fixture(scope="module")
def offset_record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short record and a recorded simulation without the offset of the record."""
    base = tmp_path_factory.mktemp("self-test")
    write_offset(base / "record.csv")
    return base


def run_self_test(base: Path, out: str, *options: object) -> tuple[str, dict]:
    """Diagnose with a self-test; return the printed text and the document."""
    with undrawn_figures():
        text = succeed(
            *("diagnose", base / "record.csv", "--input", "u_V", "--output", "y_um"),
            *("--simulation", "column:theirs_um", "--self-test", *options, "--out", base / out),
        )
    return text, json.loads((base / out / "discrepancy.json").read_text())


def stub_map(_function: object, cases: Sequence[SurrogateCase]) -> Iterator[SurrogateOutcome]:
    """Return outcomes without diagnoses: misfits above a third of the noise are recognised."""
    for case in cases:
        named = case.injection is not None and case.injection.misfit > 0.33
        yield SurrogateOutcome("offset" if named else NOTHING, named, 1.0)


def quick_self_test(
    found: Diagnosis, simulator: Simulator, tolerance: dict, seed: int, _map: ParallelMap, **options: Any
) -> SelfTest:
    return self_test(found, simulator, tolerance, seed, stub_map, **options)


@pytest.mark.parametrize(
    ("clean", "effects", "quick"),
    [
        pytest.param(40, None, True, id="stub"),
        pytest.param(4, ("offset",), False, id="small"),
        pytest.param(40, None, False, id="whole"),
    ],
)
def test_self_test_reports_detection_limits_and_false_alarms(
    offset_record: Path,
    clean: int,
    effects: tuple[str, ...] | None,
    quick: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tested = partial(quick_self_test if quick else self_test, effects=effects, clean_surrogates=clean)
    monkeypatch.setattr("lab.diagnosis.self_test.self_test", tested)
    out = f"self-test-{clean}-{quick}"
    printed, document = run_self_test(offset_record, out, "--workers", 1)
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
    assert f"Of {clean} surrogate records without an effect" in printed
    text = (offset_record / out / "report.html").read_text()
    assert "smallest detected strength" in text
    row = (
        r"offset of the output \(<code>offset</code>\)</th><td>[\d.]+ um</td><td>[\d.]+ times the noise</td>"
    )
    assert re.search(row, text)


def test_self_test_does_not_depend_on_the_number_of_workers(offset_record: Path) -> None:
    (_, serial), (_, parallel) = (
        run_self_test(offset_record, f"workers-{workers}", "--workers", workers) for workers in (1, 2)
    )
    for name in ("detection_limits", "false_alarm_rate", "p_value", "confusion"):
        assert parallel[name] == serial[name]
