"""Names from finite sets: an unknown name suggests the known names that are similar."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import islands
from islands.data.dataset import Dataset
from islands.data.preprocessing_steps import PreprocessingSteps
from islands.diagnosis.monitoring.alarm_rate import parse_alarm_rate
from islands.errors import IslandsError, suggest
from islands.estimation.parameter_constraints import constraint
from islands.evolution.presets import resolve_settings
from islands.export import export
from islands.expressions.parsing import parse
from islands.io.records.reading_options import ReadingOptions
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec, parse_spec
from islands.systems.catalogue import make_record
from islands.systems.published_models import get_published_model


def test_similar_names_are_suggested_in_the_order_of_their_similarity() -> None:
    assert suggest("monitorr", ["jobs", "monitors", "monitor"]) == ". Did you mean 'monitor', 'monitors'?"
    assert suggest("U_v", ["t_s", "u_V"]) == ". Did you mean 'u_V'?"


def test_nothing_is_suggested_for_a_name_that_resembles_none() -> None:
    assert suggest("pie", ["free-run", "holds"]) == suggest("", ["a"]) == suggest("a", []) == ""


def test_a_name_of_a_megabyte_costs_no_time_and_any_value_has_an_answer() -> None:
    assert suggest("preset" + "x" * 1_000_000, ["preset"] * 1000) == ""
    assert suggest(3, ["33"]) == ". Did you mean '33'?"  # type: ignore[arg-type]


RECORD = Dataset(np.sin(np.arange(400.0) ** 1.2), np.arange(400.0) % 7, 0.1, ("u_V",), "y")

MISTYPED = PhysicalSpec(kind="bouc-wen-piezo", parameters={"betta": 1.0})

#: What receives an unknown name in `islands`, and the name that is meant.
UNKNOWN: dict[str, tuple[Callable[[], Any], str]] = {
    "preset": (lambda: islands.identify(RECORD, preset="hysteresys"), "hysteresis"),
    "setting": (lambda: resolve_settings("narx", {"generation": 3}), "generations"),
    "topology": (lambda: resolve_settings("narx", {"topology": "tours"}), "torus"),
    "primitive": (lambda: resolve_settings("narx", {"primitives": ("tahn",)}), "tanh"),
    "library": (lambda: islands.fit(RECORD, library="polinomial"), "polynomial"),
    "estimator": (lambda: islands.fit(RECORD, library="polynomial", estimator="shoting"), "shooting"),
    "constraints": (lambda: constraint("hysterese"), "hysteresis"),
    "engine": (lambda: islands.identify(RECORD, preset="narx", engine="seriel"), "serial"),
    "function": (lambda: parse("tahn(y(k-1))"), "tanh"),
    "format": (lambda: export(get_published_model("12").model, "matlb"), "matlab"),
    "simulation": (lambda: parse_spec("second-oder"), "second-order"),
    "parameter": (lambda: make_simulator(MISTYPED, RECORD), "beta"),
    "tolerance": (lambda: islands.diagnose(RECORD, "linear:1", tolerance={"leve": 0.1}), "level"),
    "column": (lambda: islands.diagnose(RECORD, "column:simm", columns={"sim": RECORD.y}), "sim"),
    "effect": (
        lambda: islands.plan_experiment(RECORD, "bouc-wen-piezo", separate=("delya", "offset")),
        "delay",
    ),
    "system": (lambda: make_record("bouc-wen", "authors", "estimation"), "bouc-wen-piezo"),
    "part": (lambda: make_record("s1", "rescaled", "validaton"), "validation"),
    "detrend": (lambda: PreprocessingSteps(detrend="liner"), "linear"),
    "gaps": (lambda: ReadingOptions(gaps="interpolat"), "interpolate"),
    "alarm rate": (lambda: parse_alarm_rate("1 per mnth", 60.0), "month"),
}


#: They analyse a record before they read the name.
SLOW = {"effect", "engine"}


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.ci) if kind in SLOW else kind for kind in UNKNOWN]
)
def test_an_unknown_name_suggests_the_one_that_is_meant(kind: str) -> None:
    use, meant = UNKNOWN[kind]
    with pytest.raises(IslandsError, match=rf"\. Did you mean '{meant}'"):
        use()
