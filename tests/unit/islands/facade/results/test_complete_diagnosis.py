"""A diagnosis as sentences, files, figures and a simulation; the command writes the same files."""

import json
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from scipy.signal import lfilter

import islands
from islands.records.writer import write_record
from support.command_line import succeed

pytestmark = pytest.mark.ci


def made(delay=3):
    """Return a record of a linear system with a dead time."""
    rng = np.random.default_rng(0)
    u = lfilter([0.1], [1.0, -0.9], rng.standard_normal(300))
    y = lfilter([0.3], [1.0, -0.7], np.roll(u, delay)) + 0.02 * rng.standard_normal(300)
    return islands.Dataset(u[:, None], y, 0.01, ("u_V",), "y_um")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Folder with a record, and the diagnosis of a simulation without the dead time by the command."""
    folder = tmp_path_factory.mktemp("diagnosis")
    write_record(made(), folder / "r.csv")
    columns = ("--input", "u_V", "--output", "y_um", "--simulation", "linear:1")
    printed = succeed("diagnose", folder / "r.csv", *columns, "--out", folder / "command")
    (folder / "printed.txt").write_text(printed)
    return folder


@pytest.fixture(scope="module")
def found(files):
    return islands.diagnose(islands.read_record(files / "r.csv", "u_V", "y_um"), "linear:1")


def test_the_files_are_those_of_the_command(files, found, tmp_path):
    written = (files / "command" / "report.html").stat().st_mtime
    day = datetime.fromtimestamp(written, UTC).date()
    folder = found.save(tmp_path / "saved", name="r.csv", day=day)
    names = ["discrepancy.json", "extended.json", "report.html"]
    assert [path.name for path in sorted(folder.iterdir())] == names
    for name in names[1:]:
        assert (folder / name).read_bytes() == (files / "command" / name).read_bytes()
    documents = [json.loads((each / names[0]).read_text()) for each in (folder, files / "command")]
    assert [document.pop("wall_s") is None for document in documents] == [True, False]
    assert documents[0] == documents[1]


def test_a_record_outside_of_the_tested_ranges_is_stated(files, found, tmp_path):
    ranges = found.document["extension"]["ranges"]
    assert [each["name"] for each in ranges] == ["u_V", "y_um"]
    folder, other = found.save(tmp_path / "saved"), made()
    larger = replace(other, u=2.0 * other.u, y=2.0 * other.y)
    for each in (found, islands.load(folder)):
        with pytest.warns(islands.ExtrapolationWarning, match=r"^u_V is .* V in the record, and was"):
            each.simulate(larger)
    again = islands.diagnose(larger, f"model:{folder / 'extended.json'}")
    assert [each.name for each in again.record_findings] == ["extrapolation"]
    write_record(larger, tmp_path / "larger.csv")
    printed = " ".join(succeed("simulate", folder, tmp_path / "larger.csv").split())
    assert "extrapolation: u_V is " in printed
    assert "extrapolation" not in succeed("simulate", folder, files / "r.csv")


def test_an_extension_that_may_diverge_is_refused(found, tmp_path):
    refused = replace(found, trial=replace(found.trial, refusal="It is not offered: it diverges."))
    assert "It is not offered: it diverges." in refused.summary
    folder = refused.save(tmp_path / "saved")
    assert not (folder / "extended.json").exists()
    assert refused.document["extended_model"] is None
    for each in (refused, islands.load(folder)):
        with pytest.raises(islands.ModelError, match=r"diverges\. Simulate what was diagnosed, linear"):
            each.simulate(made())


@pytest.mark.parametrize(
    ("attribute", "file"),
    [
        ("write_report", "report.html"),
        ("extended_document", "extended.json"),
        ("next_input", "next-experiment.csv"),
    ],
)
def test_a_file_that_fails_leaves_the_diagnosis(attribute, file, found, tmp_path, monkeypatch):
    def fail(*_arguments):
        raise ZeroDivisionError("the step fails")

    failing = fail if attribute == "write_report" else property(fail)
    monkeypatch.setattr(islands.DiagnosisResult, attribute, failing)
    folder = found.save(tmp_path / "saved")
    assert not (folder / file).exists()
    document = json.loads((folder / "discrepancy.json").read_text())
    ((step, reason),) = [each.values() for each in document["not_computed"]]
    assert step == file
    assert reason.startswith("ZeroDivisionError: the step fails")
    loaded = islands.load(folder)
    assert f"Not computed: {file}: {reason}." in loaded.summary
    assert loaded.document["effects"] == found.document["effects"]
