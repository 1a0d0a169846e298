"""The header of a table is found below a description of the measurement, and above a row of units."""

import pytest

from islands.errors import RecordError
from islands.records.reading import preview, read_record
from islands.records.reading.formats.text.table_start import find_table

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


def test_descriptions_of_numbered_channels_are_no_samples():
    names = ("bias", "flow", "p1", "p2", "p3")
    channels = [f"{100 + k};{name};DC voltage;10" for k, name in enumerate(names)]
    rows = [f"{k};{k / 100:.2f};LLLL;LL" for k in range(8)]
    above = ("Logger", "Channel;Name;Function;Range", *channels, "")
    assert start(*above, "No;t_s;Alarm;Out", *rows).header == len(above)


def test_a_quote_in_the_header_that_is_never_closed_is_refused():
    with pytest.raises(RecordError, match=r"a\.csv, line 1: is a quote never closed\?"):
        start('t,"u,y', "0,1,2", "1,2,3")


def test_samples_without_a_header_are_refused():
    with pytest.raises(RecordError, match="line 3 is the first sample, and no line above has"):
        start("Motor 3", "x;y", *SAMPLES[:8])


@pytest.mark.parametrize("above", [(), ("Motor 3", "")])
@pytest.mark.parametrize("units", ["s;V;m3/h", ";V;m3/h", "[s];[V];[m3/h]"])
def test_a_row_of_units_may_precede_the_names(above, units):
    found = start(*above, units, "t;u;FI-2041.PV", *SAMPLES[:8])
    assert found.names[1:] == ("u [V]", "FI-2041.PV [m3/h]")
    assert (found.header, found.units) == (len(above) + 1, len(above))
    assert found.described == bool(above)


@pytest.mark.parametrize("units", [("(ms);(mV);(V)",), ()])
def test_a_blank_line_may_separate_the_header_from_the_samples(units):
    found = start("Zeit;Kanal A;Kanal B", *units, "", *SAMPLES[:8])
    assert found.first == 2 + len(units)
    assert found.names == (("Zeit [ms]", "Kanal A [mV]", "Kanal B [V]") if units else found.labels)


@pytest.mark.parametrize(("mark", "separator"), [(".", ","), (",", ";")])
def test_the_increment_below_the_header_is_the_sampling_time(tmp_path, mark, separator):
    """A Rigol oscilloscope numbers the samples and ends its lines with a separator."""
    rows = [f"{k},{k % 7}.25,{k % 11},," for k in range(60)]
    lines = ["X,CH1,CH2,Start,Increment,", "Sequence,Volt,Volt,-6.0e-03,2.0e-06", *rows]
    path = tmp_path / "scope.csv"
    path.write_text("\n".join(lines).replace(",", separator).replace(".", mark))
    record = read_record(path, ["CH1"], "CH2")
    assert record.dt == pytest.approx(2e-6)
    assert (record.input_units, record.output_unit) == (("V",), "V")
    assert record.samples == 60
    assert (
        "the sampling time of 2e-06 s is the increment below the header of scope.csv"
        in preview(path).warnings
    )


def test_the_only_column_of_time_stamps_needs_no_name(tmp_path):
    """PicoLog, and data frames with an index of times, leave the cell above the time empty."""
    path = tmp_path / "logger.csv"
    rows = [f"2024-06-11T07:{k // 4:02d}:{15 * (k % 4):02d}+02:00,{k % 7},{k % 11}" for k in range(60)]
    path.write_text("\n".join([',"u (V)","T (°C)"', *rows]))
    record = read_record(path, ["u"], "T")
    assert record.dt == 15.0
    note = "column 1 has no name and contains time stamps: it is read as column time"
    assert note in record.reading
