"""The capacity model: laws, the measurements that it must reproduce, and the page that shows its tables."""

import re
from dataclasses import replace

import pytest

from lab.service import capacity
from lab.service.capacity import LargeJob
from support.repository import ROOT

PAGE = ROOT / "docs/how-to/plan-capacity.md"


@pytest.mark.parametrize(
    ("epoch", "measured"), [(0.05, 0.75), (0.09, 0.83), (0.09, 0.85), (0.5, 0.97), (1.0, 0.98), (1.0, 0.97)]
)
def test_the_model_gives_the_measured_efficiency_of_two_islands(epoch: float, measured: float) -> None:
    """Measured without checkpoints: lab/notes/islands-on-ray.md."""
    assert LargeJob(cores=2, epoch=epoch, checkpoint=1e-9).efficiency == pytest.approx(measured, abs=0.035)


@pytest.mark.parametrize(
    ("flat", "epoch", "islands"),
    [(0.00035, 1.0, 2_900), (0.001, 1.0, 1_000), (0.00035, 3.5, 10_000), (0.001, 10.0, 10_000)],
)
def test_a_single_coordinator_saturates_where_it_was_measured(
    flat: float, epoch: float, islands: int
) -> None:
    job = LargeJob(flat=flat, epoch=epoch, region=1e9, cores=0.97 * islands)
    assert job.period == pytest.approx(epoch + job.latency)
    assert replace(job, cores=1.05 * islands).period > epoch + job.latency


def test_regions_carry_ten_thousand_islands_at_epochs_of_a_second() -> None:
    """Islands on Ray: a fifth of a core for the driver, a quarter for each of 20 coordinators."""
    job = LargeJob(cores=10_000, checkpoint=1e-9)
    assert job.regions == 20
    assert job.efficiency == pytest.approx(1.0 / 1.015)
    assert job.driver_busy / job.period == pytest.approx(0.20, abs=0.01)
    assert job.coordinator_busy / job.period == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("name", capacity.LOADS)
def test_the_page_shows_the_table_of_the_program(name: str) -> None:
    text = PAGE.read_text("utf-8")
    shown = dict(re.findall(r"^\| ([^|`]+) \| ([^|]+) \|$", text, re.MULTILINE))
    for title, value in capacity.LOADS[name]().rows():
        assert shown.get(title) == value, title
