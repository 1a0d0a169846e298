"""The header of a table is found below a description of the measurement, and above a row of units."""

import numpy as np
import pytest

from islands.errors import RecordError
from islands.io.records import preview, read_record
from islands.io.records.formats.text.table_start import find_table

SAMPLES = [f"{k / 100:.2f};{k % 7};{k % 11}" for k in range(60)]


def start(*lines):
    return find_table("\n".join(lines).splitlines(keepends=True), "a.csv")


@pytest.mark.parametrize(
    ("above", "header"),
    [
        ((), "t;u;y"),
        (("Motor 3", "", "Date: 2026-05-01; operator: K"), "t;u;y"),
        (("# Motor 3", "# gain: 2"), "# t;u;y"),
        (("Motor;3", "Date;1.5.2026"), "t;u;y"),
        (("%%%", "a,b,c,d"), "% t;u;y"),
    ],
)
def test_the_header_is_the_line_above_the_samples(above, header):
    found = start(*above, header, *SAMPLES[:8])
    assert (found.names, found.separator) == (("t", "u", "y"), ";")
    assert (found.header, found.first) == (len(above), len(above) + 1)
    assert found.described == bool(above)


@pytest.mark.parametrize(
    ("units", "names"),
    [
        ("s;V;um", ("t [s]", "u [V]", "y [um]")),
        ("[s];[V];[-]", ("t [s]", "u [V]", "y")),
        ("(s);;(m/s2)", ("t [s]", "u", "y [m/s2]")),
    ],
)
@pytest.mark.parametrize("above", [(), ("Motor 3",)])
def test_a_row_of_units_belongs_to_the_names(above, units, names):
    found = start(*above, "t;u;y", units, *SAMPLES[:8])
    assert found.names == names
    assert found.first == len(above) + 2


def test_samples_may_have_several_columns_that_repeat_a_word():
    rows = [f"{k};{k / 100:.2f};{k % 7};LLLL;LL" for k in range(8)]
    found = start("Vendor;Graph", "Channel;Name;Range", "CH1;Speed;10V", "", "No;t_s;u;Alarm;Out", *rows)
    assert (found.header, found.names) == (4, ("No", "t_s", "u", "Alarm", "Out"))


def test_descriptions_of_numbered_channels_are_no_samples():
    names = ("bias", "flow", "p1", "p2", "p3")
    channels = [f"{100 + k};{name};DC voltage;10" for k, name in enumerate(names)]
    rows = [f"{k};{k / 100:.2f};LLLL;LL" for k in range(8)]
    above = ("Logger", "Channel;Name;Function;Range", *channels, "")
    assert start(*above, "No;t_s;Alarm;Out", *rows).header == len(above)


def test_units_in_names_take_precedence_over_the_row_of_units():
    assert start("t_s;u (mV);y", "ms;V;m", *SAMPLES[:8]).names == ("t_s", "u (mV)", "y [m]")


def test_a_quoted_name_may_contain_line_ends():
    found = start('t,"u\nin","y ""x"""', "0,1,2", "1,2,3")
    assert found.names == ("t", "u\nin", 'y "x"')


def test_a_quote_in_the_header_that_is_never_closed_is_refused():
    with pytest.raises(RecordError, match=r"a\.csv, line 1: is a quote never closed\?"):
        start('t,"u,y', "0,1,2", "1,2,3")


def test_quotes_in_the_description_are_ignored():
    assert start('"Motor 5" disc', '"gain', "t,u,y", "0,1,2", "1,2,3").names == ("t", "u", "y")


def test_samples_without_a_header_are_refused():
    with pytest.raises(RecordError, match="line 3 is the first sample, and no line above has"):
        start("Motor 3", "x;y", *SAMPLES[:8])


def test_an_instrument_file_is_read(tmp_path):
    path = tmp_path / "logger.csv"
    path.write_text("\n".join(["Logger 7", "rate: 100 Hz", "", "t;u;y", "s;V;um", *SAMPLES]))
    record = read_record(path, "u [V]", "y [um]")
    assert (record.dt, record.input_units, record.output_unit) == (pytest.approx(0.01), ("V",), "um")
    np.testing.assert_array_equal(record.y, np.arange(60) % 11)
    warnings = preview(path).warnings
    assert "the header of logger.csv is line 4; the lines above are ignored" in warnings
    assert "line 5 of logger.csv is read as the units of the columns" in warnings
    path.write_text(path.read_text().replace("0.02;2;2", "0.02;x;2"))
    with pytest.raises(RecordError, match=r"logger\.csv, line 8, column u \[V\]"):
        read_record(path, "u [V]", "y [um]")


@pytest.mark.parametrize("time", ["t/s", "Zeit [s]", "Time (s)", "zeit_s", "t [s]"])
def test_common_names_of_the_time_are_read(tmp_path, time):
    path = tmp_path / "named.csv"
    path.write_text("\n".join([f"{time};U_1/mV;v_m/s", *SAMPLES]))
    record = read_record(path, "U_1/mV", "v_m/s")
    assert (record.dt, record.input_units, record.output_unit) == (pytest.approx(0.01), ("mV",), "m/s")
