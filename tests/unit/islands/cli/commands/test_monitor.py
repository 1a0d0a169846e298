"""``islands monitor``: exit codes, bad files, and a run that continues another one."""

import json

import pytest
from typer.testing import CliRunner

from islands.records.writer import write_record
from islands_api.cli.app import app
from support.monitored_oscillator import ONSET, SIMULATION, TRAINING, make_records

RECORDS = ONSET + 6


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "records").mkdir()
    return tmp_path


def write(folder, first, last):
    for index, record in enumerate(make_records(RECORDS, k=97.0)[first:last], start=first):
        name = f"2026-11-{1 + index // 24:02d}T{index % 24:02d}-00.csv"
        write_record(record, folder / "records" / name)


def run(folder, out, *more):
    (folder / "oscillator.toml").write_text(_write_toml(SIMULATION))
    simulation = f"ode:{folder / 'oscillator.toml'}"
    command = ["monitor", str(folder / "records"), "--out", str(folder / out), "--set", "settle=0"]
    command += ["--simulation", simulation, "--set", f"training={TRAINING}", *more]
    return CliRunner().invoke(app, command)


def _write_toml(spec):
    tables = [f"[states.{name}]" for name in spec["states"]]
    tables += [f"[parameters.{name}]\nvalue = {each['value']}" for name, each in spec["parameters"].items()]
    return "\n".join(
        [
            *(f'{key} = "{spec[key]}"' for key in ("name", "input", "output")),
            f'equations = """\n{spec["equations"]}"""',
            f'force = {{ coordinate = "{spec["force"]["coordinate"]}", rate = "{spec["force"]["rate"]}" }}',
            *tables,
        ]
    )


@pytest.mark.ci
def test_an_alarm_is_exit_code_3_in_the_run_that_raises_it(folder):
    write(folder, 0, ONSET)
    assert run(folder, "parts").exit_code == 0
    write(folder, ONSET, RECORDS)
    broken = folder / "records" / "2026-11-01T12-30.csv"
    broken.write_text("t_s,F,x\n0,1,a\n")
    second = run(folder, "parts")
    assert second.exit_code == 3, second.output
    assert "ALARM: k changed from" in second.output
    assert f"{broken.name}: skipped" in second.output
    assert run(folder, "parts").exit_code == 0
    parts = json.loads((folder / "parts" / "state.json").read_text())
    assert [each["name"] for each in parts["rejected"]] == [broken.name]
    assert (folder / "parts" / "monitor.svg").stat().st_size > 1000
    (alarm,) = json.loads((folder / "parts" / "monitor.json").read_text())["alarms"]
    assert (alarm["cause"], alarm["since"]["time"][:10]) == ("k", "2026-11-02")


def test_a_new_monitor_without_a_simulation_is_refused(folder):
    done = CliRunner().invoke(app, ["monitor", str(folder / "records"), "--out", str(folder / "out")])
    assert done.exit_code == 2


def test_a_folder_without_a_usable_record_is_refused(folder):
    (folder / "records" / "a.csv").write_text("t_s,F,x\n0,1,a\n")
    done = run(folder, "out")
    assert done.exit_code == 2
    assert "a.csv: skipped" in done.output


def test_records_are_read_before_kernels_are_compiled(folder, monkeypatch):
    def compile_kernels():
        raise AssertionError("kernels are compiled before a record is read")

    monkeypatch.setattr("islands.cli.commands.monitor.compile_kernels", compile_kernels)
    (folder / "records" / "2026-11-01T00-00.csv").write_text("t_s,F,x\n0,1,a\n")
    done = run(folder, "out")
    assert done.exit_code == 2, done.output
    assert "2026-11-01T00-00.csv: skipped" in done.output
