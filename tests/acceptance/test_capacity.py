"""The capacity model: laws, the measurements that it must reproduce, and the page that shows its tables."""

import re
from dataclasses import fields, replace

import pytest
from benchmarks.capacity import DAY, LargeJob, ManyJobs

from benchmarks import capacity
from support.repository import ROOT

PAGE = ROOT / "docs/how-to/plan-capacity.md"


def test_regions_carry_ten_thousand_islands_at_epochs_of_a_second() -> None:
    """Islands on Ray: a fifth of a core for the driver, a quarter for each of 20 coordinators."""
    job = LargeJob(cores=10_000, checkpoint=1e-9)
    assert job.regions == 20
    assert job.efficiency == pytest.approx(1.0 / 1.015)
    assert job.driver_busy / job.period == pytest.approx(0.20, abs=0.01)
    assert job.coordinator_busy / job.period == pytest.approx(0.25, abs=0.01)


def test_cores_beyond_the_capacity_of_the_driver_are_of_no_use() -> None:
    found = [LargeJob(cores=cores).efficiency for cores in (1, 10, 100, 1_000, 10_000, 100_000)]
    assert all(0.0 < each <= 1.0 for each in found)
    speed = [cores * LargeJob(cores=cores).efficiency for cores in (200_000, 2_000_000)]
    assert speed[0] == pytest.approx(speed[1], rel=0.01)


@pytest.mark.parametrize("cores", [1, 100, 10_000])
def test_checkpoints_take_no_more_than_their_share(cores: int) -> None:
    job = LargeJob(cores=cores)
    assert job.waiting <= job.share
    assert job.stall <= job.share * job.interval + 1e-9


@pytest.mark.parametrize("jobs", [1, 1_000, 50_000])
def test_cores_and_coordinators_suffice_for_the_work(jobs: int) -> None:
    load = ManyJobs(jobs=jobs)
    assert load.cores * DAY * load.utilisation >= jobs * load.cpu
    assert load.coordinators * DAY * load.utilisation >= jobs * load.duration
    assert load.cores >= load.coordinators * load.islands


def test_disk_grows_with_jobs_and_retention() -> None:
    def size(load: ManyJobs, title: str) -> float:
        (value,) = (text for name, text in load.rows() if name.startswith(title) and "growth" not in name)
        return float(value.split()[0])

    small = ManyJobs(jobs=10_000, retention=50)
    for title in ("database", "records and results"):
        for large in (replace(small, jobs=20_000), replace(small, retention=100)):
            assert size(large, title) == pytest.approx(2 * size(small, title), rel=0.01)


@pytest.mark.parametrize(
    ("name", "start"), [("jobs", []), ("islands", ["--cores", "300"]), ("islands", ["--cores", "1000"])]
)
def test_coefficients_are_options_that_change_the_table(
    name: str, start: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    def table(*options: str) -> str:
        capacity.main([name, *start, *options])
        return capsys.readouterr().out

    without_effect = {
        each.name
        for each in fields(capacity.LOADS[name])
        if table(
            f"--{each.name.replace('_', '-')}",
            str(each.default * (0.001 if each.metadata["most"] == 1.0 else 1_000)),
        )
        == table()
    }
    # A single coordinator and regions exclude each other.
    assert (
        without_effect <= {"flat"}
        if "1000" in start
        else without_effect <= {"region", "regional", "driver", "collection"}
    )


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("jobs", "-1"),
        ("jobs", "0"),
        ("jobs", "nan"),
        ("jobs", "inf"),
        ("jobs", "many"),
        ("utilisation", "1.1"),
    ],
)
def test_an_impossible_coefficient_is_refused(option: str, value: str) -> None:
    with pytest.raises(SystemExit):
        capacity.main(["jobs", f"--{option}", value])


@pytest.mark.parametrize("name", capacity.LOADS)
def test_the_page_shows_the_table_of_the_program(name: str) -> None:
    text = PAGE.read_text("utf-8")
    shown = dict(re.findall(r"^\| ([^|`]+) \| ([^|]+) \|$", text, re.MULTILINE))
    for title, value in capacity.LOADS[name]().rows():
        assert shown.get(title) == value, title
