"""Columns of different rates: the record has the law of the system at a common clock, and no time shift."""

from functools import cache

import numpy as np
import pandas as pd
import pytest

import islands
from islands.records.missing_outputs import skip_missing_outputs
from islands.records.reading import preview, read_record
from support.bad_records import refusal

#: A first-order system, simulated with a step of 1 ms; its input is held for 0.6 s.
STEP, END, TAU, GAIN, NOISE = 0.001, 60.0, 0.5, 2.0, 0.01


@cache
def signals(delay=0.0):
    rng = np.random.default_rng(1)
    count, late = round(END / STEP) + 1, round(delay / STEP)
    u = np.repeat(rng.uniform(0.0, 5.0, round(END / 0.6) + 1), round(0.6 / STEP))[:count]
    y, pole = np.zeros(count), np.exp(-STEP / TAU)
    for k in range(1, count):
        y[k] = pole * y[k - 1] + GAIN * (1 - pole) * (u[k - 1 - late] if k > late else 0.0)
    return u, y + rng.normal(0.0, NOISE, count)


def sample(step, first=0.0):
    """Return the numbers of the simulated samples that a clock takes."""
    return np.arange(round(first / STEP), round(END / STEP), round(step / STEP))


def join(at_u, at_y, delay=0.0, filled=False):
    """Return an outer join of an input and an output with different clocks, as a frame."""
    u, y = signals(delay)
    one = pd.DataFrame({"time_s": np.round(at_u * STEP, 6), "u_V": u[at_u]})
    two = pd.DataFrame({"time_s": np.round(at_y * STEP, 6), "y_mm": y[at_y]})
    both = one.merge(two, how="outer", on="time_s", sort=True)
    return both.ffill().dropna() if filled else both


def stack(at_u, at_y):
    """Return the rows of the output below those of the input."""
    u, y = signals()
    one = pd.DataFrame({"time_s": at_u * STEP, "u_V": u[at_u]})
    return pd.concat([one, pd.DataFrame({"time_s": at_y * STEP, "y_mm": y[at_y]})])


def hold(period, rows=0.01, first=0.0):
    """Return rows in which the output is that of the last sample of a sensor with its own period."""
    u, y = signals()
    at = sample(rows)
    last = np.floor((at * STEP - first) / period + 1e-9)
    kept = last >= 0
    taken = np.rint((first + period * last[kept]) / STEP).astype(int)
    return pd.DataFrame({"time_s": at[kept] * STEP, "u_V": u[at[kept]], "y_mm": y[taken]})


def read(tmp_path, frame, **options):
    frame.to_csv(tmp_path / "r.csv", index=False, float_format="%.6g")
    return read_record(tmp_path / "r.csv", ["u_V"], "y_mm", **options)


def fit_law(record):
    """Return the coefficients of y(k-1) and u(k-1) by least squares, and the error of a free run."""
    known = skip_missing_outputs(record)
    past = [np.column_stack((known.y[a : b - 1], known.u[a : b - 1, 0])) for a, b in known.bounds]
    target = [known.y[a + 1 : b] for a, b in known.bounds]
    pole, gain = np.linalg.lstsq(np.concatenate(past), np.concatenate(target))[0]
    free = np.array(record.y)
    for k in range(1, len(free)):
        free[k] = pole * free[k - 1] + gain * record.u[k - 1, 0]
    return pole, gain / (1 - pole), float(np.sqrt(np.nanmean((free - record.y) ** 2)))


CASES = {
    "empty cells": (lambda: join(sample(0.01), sample(0.1)), 0.1),
    "empty cells of the input": (lambda: join(sample(0.1), sample(0.01)), 0.1),
    "rows between": (lambda: join(sample(0.01), sample(0.1, 0.003)), 0.1),
    "rows between, filled": (lambda: join(sample(0.01), sample(0.1, 0.003), filled=True), 0.1),
    "two clocks of similar rates": (lambda: join(sample(0.01), sample(0.007, 0.003)), 0.007),
    "two clocks of similar rates, filled": (
        lambda: join(sample(0.01), sample(0.007, 0.003), filled=True),
        0.007,
    ),
    "two clocks of one rate": (lambda: join(sample(0.1), sample(0.1, 0.043)), 0.1),
    "slow input between": (lambda: join(sample(0.1, 0.003), sample(0.01)), 0.1),
    "stacked": (lambda: stack(sample(0.01), sample(0.1)), 0.1),
    "held": (lambda: hold(0.1), 0.1),
    "held from the middle of a block": (lambda: hold(0.1, first=0.04), 0.1),
    "held for a broken number of rows": (lambda: hold(0.097), 0.097),
}

#: Cases in which the samples of the record are those at which the input changes, or closer together.
EXACT = frozenset(CASES) - {
    "two clocks of one rate",
    "slow input between",
    "held from the middle of a block",
    "held for a broken number of rows",
}


@pytest.mark.parametrize("case", CASES)
def test_columns_of_different_clocks_give_the_law_at_the_rate_of_the_slowest(tmp_path, case):
    make, step = CASES[case]
    record = read(tmp_path, make())
    assert record.dt == pytest.approx(step, rel=1e-3)
    assert record.samples == pytest.approx(END / step, rel=0.01)
    pole, gain, error = fit_law(record)
    assert pole == pytest.approx(np.exp(-record.dt / TAU), abs=0.003)
    assert gain == pytest.approx(GAIN, rel=0.01)
    # A command that changes between two samples of the record is known by its mean only.
    assert error < (0.013 if case in EXACT else 0.022)
    assert "columns have samples at different times" in record.reading[0]
    assert f", every {record.dt:.4g} s" in record.reading[0].partition("read at those of ")[2]


@pytest.mark.nightly
@pytest.mark.parametrize("case", ["empty cells", "held"])
def test_the_defaults_find_the_law_of_columns_of_different_clocks(tmp_path, case):
    """Held values gave a dead time of nine samples, terms of friction and twelve times the error."""
    make, step = CASES[case]
    best = islands.fit(read(tmp_path, make())).best
    assert best.model.parameter_names == ("y(k-1)", "u1(k-1)")
    assert best.model.parameters[0] == pytest.approx(np.exp(-step / TAU), abs=0.003)
    assert best.metrics["validation"]["free_run"].rmse < 1.2 * NOISE


def test_a_faster_input_that_varies_between_samples_is_averaged_by_default(tmp_path):
    rng = np.random.default_rng(8)
    u = np.repeat(rng.uniform(0.0, 5.0, 2000), 3)
    y = np.zeros(6000)
    for k in range(1, 6000):
        y[k] = 0.98 * y[k - 1] + 0.04 * u[k - 1]
    y = np.where(np.arange(6000) % 10 == 0, y + rng.normal(0.0, NOISE, 6000), np.nan)
    frame = pd.DataFrame({"time_s": 0.01 * np.arange(6000), "u_V": u, "y_mm": y})
    assert "the mean from each to the next for u_V" in read(tmp_path, frame).reading[0]
    errors = [fit_law(read(tmp_path, frame, rates=rates))[2] for rates in ("mean", "sample")]
    assert errors[0] < 0.3 * errors[1]


@pytest.mark.parametrize("step", [0.05, 0.1, 0.2])
def test_resampling_interpolates_each_column_between_its_samples(tmp_path, step):
    for frame in (join(sample(0.01), sample(0.1)), hold(0.1), join(sample(0.01), sample(0.1, 0.003))):
        record = read(tmp_path, frame, resample=step)
        assert record.dt == step
        pole, gain, _ = fit_law(record)
        assert pole == pytest.approx(np.exp(-step / TAU), abs=0.05)
        assert gain == pytest.approx(GAIN, rel=0.04)


def test_a_gap_of_the_fast_input_is_refused_with_its_row(tmp_path):
    frame = join(sample(0.01), sample(0.1))
    frame.loc[1004:1006, "u_V"] = np.nan
    frame.to_csv(tmp_path / "r.csv", index=False)
    lines = (tmp_path / "r.csv").read_text().split("\n")
    message = refusal(tmp_path, lines[:-1], ("u_V",), "y_mm")
    assert "line 1002, column u_V is empty or NaN" in message
    record = read(tmp_path, frame, gaps="split")
    assert record.segments == (100, 499)


def test_a_simulation_extends_to_the_end_of_its_inputs(tmp_path):
    frame = join(sample(0.01), sample(0.1))
    frame.loc[400:, "y_mm"] = np.nan
    record = read(tmp_path, frame, missing_output=True)
    assert (record.dt, record.samples) == (pytest.approx(0.1), 600)
    assert np.isfinite(record.y).sum() == 40


def test_the_preview_of_a_file_without_a_time_counts_rows(tmp_path):
    join(sample(0.01), sample(0.1)).drop(columns="time_s").to_csv(tmp_path / "r.csv", index=False)
    found = preview(tmp_path / "r.csv")
    assert found.dt is None
    assert "columns have samples at different times: u_V in every row, y_mm every 10 rows" in found.warnings
    inspected = islands.inspect_record(tmp_path / "r.csv", dt=0.01)
    assert (inspected.sampling.samples, inspected.sampling.dt) == (600, 0.1)
    (note,) = [each for each in inspected.warnings if "different times" in each]
    assert "y_mm every 0.1 s" in note
    assert "--dt 0.01" in inspected.command


# Columns with the clock of the rows


def coarse_sensor():
    """A slow ramp in steps of a coarse sensor changes regularly."""
    u = np.sin(np.arange(3000) / 40)
    return u, np.round(np.abs((np.arange(3000) % 1000) - 500) / 10) * 0.5


def random_cells():
    u = np.random.default_rng(3).uniform(size=3000)
    return u, np.where(np.random.default_rng(4).random(3000) < 0.6, np.nan, np.cumsum(u - 0.5))


def failed_sensor():
    u = np.random.default_rng(3).uniform(size=3000)
    return u, np.where((np.arange(3000) // 600) % 2 == 1, np.nan, np.cumsum(u - 0.5))


def slow_command():
    """A command with many levels, and a system with memory."""
    u = np.repeat(np.random.default_rng(5).uniform(0.0, 5.0, 100), 30)
    y = np.zeros(3000)
    for k in range(1, 3000):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1]
    return u, y


@pytest.mark.parametrize("make", [coarse_sensor, random_cells, failed_sensor, slow_command])
def test_other_records_have_the_clock_of_the_rows(make):
    u, y = make()
    record = islands.as_record({"t_s": 0.01 * np.arange(len(u)), "u": u, "y": y}, inputs="u", output="y")
    assert (record.samples, record.dt, record.reading) == (len(u), pytest.approx(0.01), ())
