"""Case 2: the layouts of the measured records, the drift, and the record in their place."""

import json

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.reproduction import case2
from islands.reproduction.case2 import remove_drift, simulate_substitute, take_record
from islands.reproduction.tasks import ReproductionOptions, run_tasks
from support.undrawn import undrawn_figures


@pytest.fixture(scope="module")
def rig():
    """Return the record in place of the measured one, with offsets and a drift."""
    record = simulate_substitute(1600)
    return Dataset(record.u + 0.3, record.y + 4.0 + 20.0 * record.time, record.dt, ("u_V",), "y_um")


def write(path, rig, header, index=True, start=0.0):
    time = start + rig.dt * np.arange(rig.samples)
    columns = [time, rig.y, rig.u[:, 0]]
    columns = [np.arange(rig.samples), *columns] if index else columns
    lines = [header] * bool(header) + [
        ",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


@pytest.mark.parametrize("header", ["index,time,output,input", ",time,output,input", ""])
def test_the_file_of_the_owners_is_read_with_and_without_a_header(tmp_path, rig, header):
    taken = take_record(write(tmp_path / "h50us.csv", rig, header), quick=False)
    assert taken.record.samples == rig.samples
    assert taken.record.dt == pytest.approx(5e-5)
    assert np.corrcoef(taken.record.u[:, 0], rig.u[:, 0])[0, 1] == pytest.approx(1.0)
    assert not taken.simulated
    assert "h50us.csv" in taken.source


def test_the_record_at_150_volts_begins_when_the_rig_moves(tmp_path, rig):
    slow = Dataset(rig.u, rig.y, 0.01, ("u_V",), "y_um")
    taken = take_record(write(tmp_path / "slow.csv", slow, "t_s,y_um,u_V", index=False), quick=False)
    assert taken.record.time[0] == pytest.approx(5.01)
    assert "another test" in taken.source


def test_other_columns_are_refused_with_both_layouts(tmp_path):
    path = tmp_path / "two.csv"
    path.write_text("u_V,y_um\n" + "1,2\n" * 20)
    with pytest.raises(RecordError, match=r"other columns: .*4 \(index, time, output, input\)"):
        take_record(str(path), quick=False)


@pytest.mark.parametrize("cycles", [3.0, 5.25, 8.0])
def test_drift_is_removed_although_the_sine_has_few_or_broken_periods(cycles):
    """The sine tilts a line that is fitted alone."""
    t = np.arange(2000) / 2000
    u = np.sin(2 * np.pi * cycles * t)
    delayed = 3.0 * np.sin(2 * np.pi * cycles * t - 0.3)
    clean = remove_drift(Dataset(u + 2.0, delayed + 7.0 - 1.5 * t, 1 / 2000))
    assert np.ptp(clean.y - delayed) < 1e-3 < abs(np.polyfit(t, delayed, 1)[0])
    assert clean.u.mean() == pytest.approx(0.0, abs=1e-12)


@pytest.fixture(scope="module")
def section(tmp_path_factory):
    options = ReproductionOptions(quick=True)
    return case2.summarise(run_tasks(case2.plan(options), tmp_path_factory.mktemp("tasks")), options)


def test_a_simulated_record_is_called_so_in_every_title_and_reason(section):
    titles = [section.title, *(table.title for table in section.tables)]
    assert all("simulated in place of the measured record" in title for title in titles)
    assert all("simulated in place" in figure.caption for figure in section.figures)
    assert all("simulated" in row[-1] for table in section.tables for row in table.rows)
    assert "h50us.csv" in section.introduction[0]


def test_numbers_of_a_section_are_json(section):
    assert json.loads(json.dumps(section.document, allow_nan=False)) == section.document


def test_a_measured_record_is_not_called_simulated(tmp_path, rig):
    options = ReproductionOptions(
        data=write(tmp_path / "h50us.csv", rig, "index,time,output,input"), quick=True
    )
    found = case2.summarise(run_tasks(case2.plan(options), tmp_path / "tasks"), options)
    assert not any("simulated" in text for text in (found.title, *found.introduction))
    assert len(found.tables[0].rows[0]) == 5
    assert found.tables[0].rows[0][2] != "-"


def test_another_content_of_the_file_is_another_task(tmp_path, rig):
    path = tmp_path / "h50us.csv"
    options = ReproductionOptions(data=write(path, rig, "index,time,output,input"))
    first = case2.plan(options)[0].fingerprint
    path.write_text(path.read_text() + "\n")
    assert case2.plan(options)[0].fingerprint != first


def test_figures_of_case_2_have_the_panels_of_the_paper(section):
    with undrawn_figures():
        data, validation = (figure.draw("dark") for figure in section.figures)
    assert len(data.axes) == 2
    assert [axes.get_title(loc="left")[:3] for axes in validation.axes] == ["(a)", "(b)", "(c)", "(d)"]
