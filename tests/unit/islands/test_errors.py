"""Names from finite sets: an unknown name suggests the known names that are similar."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import islands
from islands.diagnosis.monitoring.alarm_rate import parse_alarm_rate
from islands.errors import IslandsError, command_line_names, name_option, suggest
from islands.estimation.parameter_constraints import constraint
from islands.evolution.presets import resolve_settings
from islands.export import export
from islands.expressions.parsing import parse
from islands.records.dataset import Dataset
from islands.records.preprocessing_steps import PreprocessingSteps
from islands.records.reading.options import ReadingOptions
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import PhysicalSpec, parse_spec
from islands.systems.catalogue import make_record
from islands.systems.published_models import get_published_model
from islands_api.cli.app import app


def test_similar_names_are_suggested_in_the_order_of_their_similarity() -> None:
    assert suggest("monitorr", ["jobs", "monitors", "monitor"]) == ". Did you mean 'monitor', 'monitors'?"
    assert suggest("U_v", ["t_s", "u_V"]) == ". Did you mean 'u_V'?"


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


#: Options with a value, as an argument of the library and on the command line.
OPTIONS = [
    ("gaps", "split", 'gaps="split"', "--set gaps=split"),
    ("gaps", None, "gaps=", "--set gaps="),
    ("header", False, "header=False", "--set header=false"),
    ("names", ["a", "b"], "names=['a', 'b']", "--set names=a,b"),
    ("resample", 0.0123456789, "resample=0.0123457", "--set resample=0.0123457"),
    ("dt", "DT", "dt=DT", "--dt DT"),
    ("missing", "Sensor 3", 'missing="Sensor 3"', "--set 'missing=Sensor 3'"),
]


@pytest.mark.parametrize(("name", "value", "argument", "flag"), OPTIONS)
def test_an_option_is_named_as_the_caller_gives_it(
    name: str, value: object, argument: str, flag: str
) -> None:
    assert name_option(name, value) == argument
    with command_line_names({"gaps", "header", "names", "resample", "missing"}):
        assert name_option(name, value) == flag
    assert name_option(name, value) == argument


def test_a_message_names_an_option_as_its_caller_gives_it(
    tmp_path: Path,
) -> None:
    rows = [f"{k % 7},{k % 5}" for k in range(60)]
    (tmp_path / "r.csv").write_text("\n".join(["u,y", *rows]))
    with pytest.raises(islands.RecordError, match=r"sampling time by dt=, or name the column by time=$"):
        islands.read_record(tmp_path / "r.csv", ["u"], "y")
    command = ["fit", str(tmp_path / "r.csv"), "--input", "u", "--output", "y", "--out", str(tmp_path / "o")]
    done = CliRunner().invoke(app, command)
    assert "sampling time by --dt, or name the column by --set time=" in " ".join(done.stderr.split())


def test_no_text_about_a_record_or_a_result_has_a_flag() -> None:
    """Texts of files are for every caller; messages name options by `name_option`."""
    package = Path(islands.__file__).parent
    sources = [path for folder in ("io", "diagnosis", "reports") for path in (package / folder).rglob("*.py")]
    assert not [path.name for path in sources if re.search(r"--[a-z]{2,}", path.read_text())]
