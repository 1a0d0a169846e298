"""Measured records: each is read, or refused with the reason."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.records.reading import read_record
from support.repository import measured_record


@pytest.mark.nightly
def test_the_piezo_record_is_sampled_at_a_fifth_of_a_millisecond():
    record = read_record(measured_record("piezo_micromanipulator_150V_1Hz.csv"), ["u_V"], "y_um")
    assert record.dt == pytest.approx(2e-4, rel=1e-6)
    assert (record.samples, record.start) == (50_001, 0.0)
    assert (record.input_units, record.output_unit) == (("V",), "um")
    assert (record.u[-1, 0], record.y[-1]) == (-118.05964, -13.938904)


@pytest.mark.nightly
def test_silverbox_is_read_with_its_stated_sampling_frequency():
    file = measured_record("silverbox.npz")
    record = read_record(file, ["u"], "y", rows=slice(40650, 105712))
    assert record.samples == 65_062
    assert record.dt == pytest.approx(1 / 610.35, rel=1e-12)
    assert record.start == pytest.approx(40650 / 610.35)
    with np.load(file) as arrays:
        assert record.y[0] == arrays["y"][40650]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("name", "inputs", "output", "dt", "samples", "step"),
    [
        ("cascaded_tanks.csv", ["u_est_V"], "y_est_V", None, 1024, 4.0),
        ("gas_furnace.csv", ["u_gasrate_ft3min"], "y_CO2_pct", None, 296, 9.0),
        ("daisy_hairdryer.csv", ["u_V"], "y_temp", 0.08, 1000, 0.08),
        ("wh2009.npz", ["u"], "y", None, 188_000, 1 / 51_200),
        ("boucwen_benchmark.npz", ["u_train_N"], "y_train_m", None, 40_960, 1 / 750),
    ],
)
def test_the_measured_records_are_read(name, inputs, output, dt, samples, step):
    record = read_record(measured_record(name), inputs, output, dt=dt)
    assert record.samples == samples
    assert record.dt == pytest.approx(step, rel=1e-9)


@pytest.mark.nightly
def test_buck_converter_parts_are_consecutive_in_time():
    file = measured_record("buck_converter.csv")
    whole = read_record(file, ["u_V"], "y_V")
    assert whole.samples == 2000
    assert whole.dt == pytest.approx(1e-5, rel=1e-9)
    validation = read_record(file, ["u_V"], "y_V", rows=slice(1001, None))
    assert validation.start == pytest.approx(0.01001)
    assert validation.y[0] == 15.6


@pytest.mark.nightly
def test_the_hair_dryer_needs_its_sampling_time():
    with pytest.raises(RecordError, match=r"daisy_hairdryer\.csv has no time column .* dt="):
        read_record(measured_record("daisy_hairdryer.csv"), ["u_V"], "y_temp")


@pytest.mark.nightly
def test_damper_tests_are_separated_by_their_time():
    file = measured_record("mrdamper_labcontrol.csv")
    with pytest.raises(RecordError, match=r"line 3003, column t_s jumps back to 0 from 30 .*gaps=\"split\""):
        read_record(file, ["volt_V", "dist_mm"], "force_N")
    assert read_record(file, ["dist_mm"], "force_N", rows=slice(0, 3001)).dt == pytest.approx(0.01)


@pytest.mark.nightly
def test_mirror_arrays_of_many_realisations_are_refused_with_their_shape():
    with pytest.raises(RecordError, match=r"u_100mV_train has the shape \(8192, 3, 6, 2\)"):
        read_record(measured_record("fsm_piezo.npz"), ["u_100mV_train"], "y_um_100mV_train")
