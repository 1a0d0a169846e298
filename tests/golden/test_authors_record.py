"""Record of case study 1, computed from a separate transcription of the authors' published notebook.

Source: the notebook that accompanies the paper, section 6.1. The transcription is independent of the package.
It keeps the time axis of the notebook, the slope array that is one sample late in the estimation part, and
the explicit Runge-Kutta steps.
"""

import numpy as np
import pytest
import scipy

from islands.systems.bouc_wen import BoucWenPiezo, authors_estimation, authors_validation, simulate


def rates(v, h):
    """Return the right-hand side of the first line of equation (11) with the parameters of the paper."""
    return 0.9 * v - 0.008 * abs(v) * h - 0.008 * v * abs(h)


def displacement(volts, slopes):
    """Integrate as the notebook does: step k to k + 1 with slopes[k], in plain floats."""
    h, out = 0.0, []
    for volt, v in zip(volts.tolist(), slopes.tolist(), strict=True):
        out.append(1.6 * volt - h)
        k1 = rates(v, h)
        k2 = rates(v, h + 0.0005 * k1)
        k3 = rates(v, h + 0.0005 * k2)
        k4 = rates(v, h + 0.001 * k3)
        h += 0.001 / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(out)


@pytest.fixture(scope="module")
def notebook():
    """Return voltage and displacement of both parts, with the first estimation row."""
    t = np.arange(0, 101, 0.001)
    x = np.random.RandomState(93862723).normal(0, 450, len(t))
    x[:1000] = x[-1000:] = 0
    b, a = scipy.signal.butter(5, 0.002)
    u = scipy.signal.filtfilt(b, a, x)
    late = (u[1:] - u[:-1]) / (t[1:] - t[:-1])
    train = displacement(u[1000:], late[999:])
    sine = 40 * np.sin(2 * np.pi * t[1000:])
    prompt = np.append((sine[1:] - sine[:-1]) / (t[1001:] - t[1000:-1]), 0.0)
    return u[1000:], train, sine, displacement(sine, prompt)


@pytest.fixture(scope="module")
def estimation():
    return authors_estimation()


@pytest.fixture(scope="module")
def validation():
    return authors_validation()


def test_estimation_record_equals_that_of_the_notebook(notebook, estimation):
    volts, displaced, _, _ = notebook
    np.testing.assert_allclose(estimation.u[:, 0], volts[1:], rtol=0, atol=1e-12)
    np.testing.assert_allclose(estimation.y, displaced[1:], rtol=0, atol=1e-12)


def test_validation_record_equals_that_of_the_notebook(notebook, validation):
    _, _, volts, displaced = notebook
    np.testing.assert_allclose(validation.u[:, 0], volts, rtol=0, atol=1e-12)
    np.testing.assert_allclose(validation.y, displaced, rtol=0, atol=1e-12)


def test_sample_counts_times_and_peaks_equal_those_of_the_paper(estimation, validation):
    assert (estimation.samples, validation.samples) == (99_999, 100_000)
    assert (estimation.dt, validation.dt) == (1e-3, 1e-3)
    assert estimation.time[0] == pytest.approx(1.001, abs=1e-12)
    assert validation.time[0] == pytest.approx(1.0, abs=1e-12)
    assert np.abs(estimation.u).max() == pytest.approx(58.8, abs=0.05)
    assert np.abs(validation.u).max() == pytest.approx(40.0, abs=1e-9)


def test_record_has_golden_values(estimation, validation):
    # Independent of the package and of the transcription, so that a change in SciPy is detected. The filter
    # of the notebook (order five, 0.002 of Nyquist) amplifies the last bit of the linear algebra to 2.5e-4,
    # and that bit differs between processors.
    assert estimation.u[0, 0] == pytest.approx(-6.6788, abs=1e-3)
    assert estimation.y[0] == pytest.approx(-10.7255, abs=1e-3)
    assert np.abs(estimation.u).max() == pytest.approx(58.7775, abs=1e-3)
    assert estimation.y[49_999] == pytest.approx(-26.9289, abs=1e-3)
    assert validation.y[250] == pytest.approx(37.41019885244359, abs=1e-8)


def test_dropped_first_row_has_an_output_step(estimation):
    # In the dropped row the notebook sets the output to zero.
    assert abs(estimation.y[0] - 0.0) == pytest.approx(10.7, abs=0.05)


def test_slope_is_one_sample_late_only_in_the_estimation_record(estimation, validation):
    def misfit(record, lag):
        """Return the largest error in um against a simulation whose slopes are ``lag`` samples late."""
        u = record.u[:, 0]
        slope = np.diff(u)[1 - lag : len(u) - 1 - lag] / record.dt
        h0 = 1.6 * u[1] - record.y[1]
        return np.abs(simulate(BoucWenPiezo(), u[1:], record.dt, slope=slope, h0=h0) - record.y[1:]).max()

    assert misfit(estimation, lag=1) < 1e-8
    assert misfit(estimation, lag=0) > 0.1
    assert misfit(validation, lag=0) < 1e-8
    assert misfit(validation, lag=1) > 0.1
