import shlex

import numpy as np
import pytest

import islands
from islands.cli.options import columns
from islands.facade.inspect_table import inspect_table
from islands.records.reading.options import DEFAULT_READING, ReadingOptions
from islands.records.reading.preview import preview_table
from islands.records.reading.reader import open_record
from islands.report.text.inspection import format_inspection
from islands.report.text.layout import WIDTH
from support.known_records import delay, lag, measure, steps


def write(path, time=None, drop=(), blank=(), header="t_s,u_V,y_um"):
    """Write a record with a dead time of 4 samples of 0.1 s; leave out rows, or cells of the input."""
    u = steps(1500, 0, 10)
    record = measure(u, delay(lag(u, 5.0), 3), 0.02)
    stamps = 0.1 * np.arange(1500) if time is None else time
    cells = [f"{stamps[k]:.3f},{'' if k in blank else record.u[k, 0]},{record.y[k]}" for k in range(1500)]
    rows = [row for k, row in enumerate(cells) if k not in drop]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def inspect(file, *columns, reading=DEFAULT_READING, **options):
    """Inspect a file without its linear model."""
    table = open_record(file, reading)
    found = preview_table(table, file.name, reading)
    return inspect_table(table, file, found, *columns, reading=reading, **options)


@pytest.mark.parametrize("name", ["Voltage, V", "drive,left"])
def test_the_suggested_command_names_a_column_with_a_comma(tmp_path, name):
    file = write(tmp_path / "r.csv", header=f't_s,"{name}",y_um')
    words = shlex.split(inspect(file, [name], "y_um").command)
    assert columns([words[words.index("--input") + 1]]) == [name]


def test_gaps_are_reported_with_rows_and_no_fact_reads_across_them(tmp_path):
    found = inspect(write(tmp_path / "r.csv", drop=range(400, 420)))
    assert found.sampling.gaps == ("line 402",)
    assert found.sampling.counts["missing"] == 20
    assert found.record.segments == (400, 1080)
    assert "line 402" in found.warnings[0]
    assert "--set gaps=split" in found.command
    assert found.find("dead-time").value == 4


@pytest.mark.parametrize("rows_between", [False, True])
def test_columns_of_different_rates_are_described_at_their_common_clock(tmp_path, rows_between):
    """The input has five samples for one of the output, at the same times or between them."""
    u = steps(7500, 0, 50)
    y = measure(u, delay(lag(u, 25.0), 15), 0.02).y
    late = 0.007 if rows_between else 0.0
    one = [(0.02 * k, f"{0.02 * k:.3f},{value:.6f},") for k, value in enumerate(u)]
    two = [(0.1 * k + late, f"{0.1 * k + late:.3f},,{y[5 * k]:.6f}") for k in range(1500)]
    rows = [text for _, text in sorted(one + two)]
    if not rows_between:
        rows = [f"{0.02 * k:.3f},{u[k]:.6f},{y[k] if k % 5 == 0 else ''}" for k in range(7500)]
    file = tmp_path / "r.csv"
    file.write_text("\n".join(["t_s,a,b", *rows]) + "\n")
    found = inspect(file)
    assert (found.sampling.samples, found.sampling.dt) == (1500, 0.1)
    assert (found.choice.inputs, found.choice.output) == (("a",), "b")
    assert abs(found.find("dead-time").value - 4) <= 1
    (note,) = found.warnings
    assert note.startswith("columns have samples at different times: a ")
    assert found.command == f"islands identify {file} --input a --output b --out result"
    read = islands.read_record(file, found.choice.inputs, found.choice.output)
    assert (read.samples, read.reading) == (1500, (note,))


@pytest.mark.parametrize(
    ("change", "option"),
    [
        ({"blank": range(700, 705)}, "--set gaps=split"),
        ({"time": np.round(0.1 * np.arange(1500) + 0.04 * np.sin(np.arange(1500)), 3)}, "--set resample="),
    ],
)
def test_the_suggested_command_can_read_the_record(tmp_path, change, option):
    file = write(tmp_path / "r.csv", **change)
    found = inspect(file)
    name, value = found.command.partition("--set ")[2].split()[0].split("=")
    assert option in found.command or float(value) == pytest.approx(0.1, rel=0.05)
    repair = {name: value if value == "split" else float(value)}
    assert islands.read_record(file, ["u_V"], "y_um", **repair).samples > 1400


def test_text_has_80_columns(tmp_path):
    long = "t_s,u_" + "very_long_name_" * 5 + "V,y_um"
    for options in ({}, {"header": long}, {"drop": range(100, 900, 50)}):
        text = format_inspection(inspect(write(tmp_path / "r.csv", **options)))
        lines = [line for line in text.splitlines() if "very_long" not in line and str(tmp_path) not in line]
        assert max(map(len, lines)) <= WIDTH
        assert "Next:" in text


def test_a_remedy_makes_the_record_usable_and_has_no_problem_left(tmp_path):
    times = [*range(100), *range(150, 250)]
    rng = np.random.default_rng(0)
    u = rng.normal(size=len(times))
    y = np.convolve(u, [0.0, 1.0, 0.5])[: len(times)]
    rows = (f"{t},{a:.4f},{b:.4f}" for t, a, b in zip(times, u, y, strict=True))
    (tmp_path / "a.csv").write_text("\n".join(["t_s,u,y", *rows]))
    found = inspect(tmp_path / "a.csv", ["u"], "y")
    (problem,) = (note for note in found.notes if note.is_problem)
    assert problem.rows == (100,)
    assert found.remedy == {"gaps": "split"}
    repaired = inspect(tmp_path / "a.csv", ["u"], "y", reading=ReadingOptions(**found.remedy))
    assert not any(note.is_problem for note in repaired.notes)
    assert (repaired.remedy, repaired.sampling.problem) == ({}, "")
    # Rows are counted from the beginning of the file.
    part = inspect(tmp_path / "a.csv", ["u"], "y", rows=slice(50, 200))
    assert [note.rows for note in part.notes if note.is_problem] == [(100,)]
