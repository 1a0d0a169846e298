"""Sixty record files as loggers and people write them, with measurements of known laws in them."""

import gzip
import zipfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from support.known_laws import Measurement, Signal
from support.odd_files import START, write_hdf5, write_mat, write_npz, write_tdms, write_workbook

#: Samples of a record.
SAMPLES = 1200


@dataclass(frozen=True)
class AwkwardRecord:
    """A file with a measurement of a known law.

    Attributes
    ----------
    title : str
    law : str
        Entry of the known laws.
    name : str
        Name of the file.
    write : callable
        Writes a measurement to a path.
    inputs : tuple of str
        Input columns.
    output : str
        Output column.
    dt : float
        Sampling time in seconds.
    given : tuple of str
        Options of the command for what the file does not contain, such as its sampling time.
    factor : float
        Unit of the signals of the law in those of the file.
    """

    title: str
    law: str
    name: str
    write: Callable[[Path, Measurement], object]
    inputs: tuple[str, ...]
    output: str
    dt: float = 0.1
    given: tuple[str, ...] = ()
    factor: float = 1.0


Cells = Sequence[str]
Columns = tuple[Cells, ...]


def cells(values: Iterable[float], form: str = "{:.6g}", mark: str = ".") -> list[str]:
    """Return numbers as text."""
    return [form.format(value).replace(".", mark) for value in values]


def table(
    names: Sequence[str],
    columns: Sequence[Cells],
    separator: str = ",",
    above: Sequence[str] = (),
    below: Sequence[str] = (),
    end: str = "\n",
) -> str:
    """Return columns of cells as a text."""
    header = [separator.join(names)] if names else []
    rows = [separator.join(row) for row in zip(*columns, strict=True)]
    return end.join([*above, *header, *rows, *below]) + end


def plain(m: Measurement, mark: str = ".", form: str = "{:.6g}") -> Columns:
    """Return the time, the inputs and the output as cells."""
    return tuple(
        cells(each, own, mark) for each, own in ((m.t, "{:.10g}"), *((u, form) for u in m.u.T), (m.y, form))
    )


def stamps(m: Measurement, form: str, start: datetime = START) -> list[str]:
    """Return the times of the samples as text."""
    return [(start + timedelta(seconds=float(t))).strftime(form) for t in m.t]


def clock(m: Measurement, form: str, start: datetime = START, digits: int = 3) -> list[str]:
    """Return the times of the samples as text with some digits of a second in place of six."""
    return [text[: len(text) - 6 + digits] for text in stamps(m, form, start)]


Content = Callable[[Measurement], str]


def text(content: Content, encoding: str = "utf-8") -> Callable[[Path, Measurement], object]:
    """Return a function that writes a text."""
    return lambda path, m: path.write_bytes(content(m).encode(encoding))


def simple(header: str, separator: str = ",", **options: object) -> Content:
    """Return a function that makes a table of time, inputs and output."""
    mark = str(options.pop("mark", "."))
    return lambda m: table(header.split(separator), plain(m, mark), separator, **options)  # type: ignore[arg-type]


def timed(
    header: str, times: Callable[[Measurement], Cells], separator: str = ",", mark: str = "."
) -> Content:
    """Return a function that makes a table with other times."""
    return lambda m: table(header.split(separator), (times(m), *plain(m, mark)[1:]), separator)


def changed(header: str, change: Callable[[Signal], Signal]) -> Content:
    """Return a function that makes a table with a changed output."""
    return lambda m: table(header.split(","), (*plain(m)[:-1], cells(change(m.y.copy()))))


def worded(header: str, change: Callable[[list[list[str]]], object]) -> Content:
    """Return a function that makes a table with changed cells: a list of columns."""

    def make(m: Measurement) -> str:
        columns = [list(column) for column in plain(m)]
        change(columns)
        return table(header.split(","), columns)

    return make


def put(values: dict[int, float]) -> Callable[[Signal], Signal]:
    """Return a function that puts values into a signal."""

    def change(y: Signal) -> Signal:
        y[list(values)] = list(values.values())
        return y

    return change


def _spikes(y: Signal) -> Signal:
    y[[211, 540, 871]] += 3.0 * np.ptp(y) * np.array([1.0, -1.0, 1.0])
    return y


def _stuck(y: Signal) -> Signal:
    y[500:640] = y[499]
    return y


def _clipped(y: Signal) -> Signal:
    return np.minimum(y, np.quantile(y, 0.93))


# Files of programs.


def single(write: Callable[[Path, Signal, Signal, Signal], object]) -> Callable[[Path, Measurement], object]:
    """Return a writer of a measurement with one input."""
    return lambda path, m: write(path, m.t, m.u[:, 0], m.y)


def write_dated_workbook(path: Path, m: Measurement) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["Datum", "Ventil", "Temperatur"])
    for t, u, y in zip(m.t, m.u[:, 0], m.y, strict=True):
        book.active.append([START.replace(microsecond=0) + timedelta(seconds=float(t)), float(u), float(y)])
    book.save(path)


def write_parquet(path: Path, m: Measurement) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    times = np.datetime64(START, "ns") + (m.t * 1e9).round().astype("timedelta64[ns]")
    pq.write_table(pa.table({"time": times, "u_V": m.u[:, 0], "y_um": m.y}), path)


def write_mdf(path: Path, m: Measurement) -> None:
    from asammdf import MDF
    from asammdf import Signal as Channel

    with MDF(version="4.10") as file:
        file.append([Channel(m.u[:, 0], m.t, name="u", unit="V"), Channel(m.y, m.t, name="y", unit="um")])
        file.save(path, overwrite=True)


def write_gzip(path: Path, m: Measurement) -> None:
    path.write_bytes(gzip.compress(simple("t_s,u_V,y_um")(m).encode()))


def write_zip(path: Path, m: Measurement) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run 7/r.csv", simple("t_s,u_V,y_um")(m))
        archive.writestr("readme.md", "measured on bench 3")
        archive.writestr("__MACOSX/._r.csv", "x")


# Texts of loggers.


def oscilloscope(m: Measurement) -> str:
    above = (
        "Model,MDO3024",
        "Firmware,1.26",
        f"Interval,{m.dt}",
        f"Points,{len(m.t)}",
        "Gain,1",
        "Zero,0",
        "",
    )
    return table(("TIME", "CH1", "CH2"), plain(m), above=above)


def labview(m: Measurement) -> str:
    above = (
        *("LabVIEW Measurement", "Writer_Version\t2", "***End_of_Header***", ""),
        *(
            "Channels\t2",
            f"Samples\t{len(m.t)}\t{len(m.t)}",
            f"Delta_X\t{m.dt}\t{m.dt}",
            "***End_of_Header***",
        ),
    )
    return table(("X_Value", "u_V", "y_um", "Comment"), (*plain(m), [""] * len(m.t)), "\t", above)


def desk(m: Measurement) -> str:
    above = ('path,"time","In/u","Out/y"', 'type,"x","y","y"', 'unit,"s","V","-"')
    return table((), (["trace_values", *[""] * (len(m.t) - 1)], *plain(m)), above=above)


def codesys(m: Measurement, every: int = 1) -> str:
    """Return a trace of a controller: a block of keys, and of times and values, for each variable."""
    lines = ["[key]; [value]", "Version; 0x03050000", "Name; Application.Trace", "IecTaskName; MainTask"]
    for place, (name, values) in enumerate((("GVL.u", m.u[:, 0]), ("GVL.y", m.y))):
        lines += [f"{place}.Variable; {name}", f"{place}.Class; 14", f"{place}.Size; 4", f"{place}.Data; "]
        step = every if place else 1
        samples = zip(m.t[::step], values[::step], strict=True)
        lines += [f"; {1e3 * t:.0f}; {value:.6g}" for t, value in samples]
    return "\n".join(lines) + "\n"


def properties(m: Measurement) -> str:
    """Return a table whose first columns have properties of the instrument in the first samples."""
    count = len(m.t)
    names = ["Interval", "Points", *[""] * (count - 2)]
    values = [f"{m.dt}", f"{count}", *[""] * (count - 2)]
    return table((), (names, values, *plain(m)))


def fixed_width(m: Measurement) -> str:
    rows = ("".join(f"{float(cell):14.6f}" for cell in row) for row in zip(*plain(m), strict=True))
    return "\n".join(["         Zeit        Druck        Kraft", *rows]) + "\n"


def grafana(m: Measurement) -> str:
    _, u, y = plain(m)
    units = ([f"{cell} %" for cell in u], [f"{cell} °C" for cell in y])
    quoted = [[f'"{cell}"' for cell in column] for column in (clock(m, "%Y-%m-%d %H:%M:%S.%f"), *units)]
    return table(('"Time"', '"valve"', '"room"'), quoted)


def newest_first(m: Measurement) -> str:
    return table(("t_s", "u_V", "y_um"), tuple(column[::-1] for column in plain(m)))


def statuses(m: Measurement) -> str:
    """Return a table with a counter, a status and an empty column besides the signals."""
    count = len(m.t)
    time, u, y = plain(m)
    columns = (cells(range(1, count + 1)), time, ["RUN"] * count, u, ["0"] * count, y, [""] * count)
    return table(("No.", "t [s]", "State", "u [V]", "Alarm", "y [um]", ""), columns, ";")


def euro_thousands(m: Measurement) -> str:
    """Return European numbers with points between thousands."""
    columns = (
        [f"{t:.1f}".replace(".", ",") for t in m.t],
        *(
            [f"{1000 * value:,.2f}".translate(str.maketrans(",.", ".,")) for value in each]
            for each in (m.u[:, 0], m.y)
        ),
    )
    return table(("Zeit [s]", "Kraft [N]", "Weg [um]"), columns, ";")


def exponents(m: Measurement) -> str:
    columns = (plain(m, ",")[0], *(cells(each, "{:.6E}", ",") for each in (m.u[:, 0], m.y)))
    return table(("Temps (s)", "Tension (V)", "Débit (l/s)"), columns, ";")


def midnight(m: Measurement) -> list[str]:
    return clock(m, "%H:%M:%S.%f", datetime(2026, 11, 22, 23, 59, 3))


def summer_time(m: Measurement) -> list[str]:
    """Return local times with offsets over the end of summer time."""
    begin = datetime(2026, 10, 25, 0, 30)
    times = [begin + timedelta(seconds=float(t)) for t in m.t]
    change = datetime(2026, 10, 25, 1, 0)
    return [
        (each + timedelta(hours=2 if each < change else 1)).strftime("%Y-%m-%dT%H:%M:%S")
        + ("+02:00" if each < change else "+01:00")
        for each in times
    ]


# Kinds of faults.


def slow_rows(m: Measurement, every: int = 10) -> tuple[Signal, Signal]:
    """Return the times of the fast rows, and the input at each."""
    times = m.dt / every * np.arange(every * len(m.t))
    return times, m.waves[0].values(times)


def empty_between(m: Measurement) -> str:
    times, u = slow_rows(m)
    y = [cell if not k else "" for cell in plain(m)[-1] for k in range(10)]
    return table(("t_s", "u_V", "y_um"), (cells(times, "{:.10g}"), cells(u), y))


def held_between(m: Measurement) -> str:
    times, u = slow_rows(m)
    y = [cell for cell in plain(m)[-1] for _ in range(10)]
    return table(("t_s", "u_V", "y_um"), (cells(times, "{:.10g}"), cells(u), y))


def outer_join(m: Measurement) -> str:
    fast = 0.3 * m.dt * np.arange(int(len(m.t) / 0.3)) + 0.007 * m.dt
    rows = [(t, f"{value:.6g}", "") for t, value in zip(fast, m.waves[0].values(fast), strict=True)]
    rows += [(t, "", cell) for t, cell in zip(m.t, plain(m)[-1], strict=True)]
    rows.sort()
    return table(
        ("t_s", "u_V", "y_um"),
        (cells((row[0] for row in rows), "{:.10g}"), *zip(*[row[1:] for row in rows], strict=True)),
    )


def late_column(m: Measurement) -> str:
    time, u, y = plain(m)
    return table(("t_s", "u_V", "y_um"), (time, u, [*[""] * 200, *y[200:]]))


def with_units(m: Measurement) -> str:
    time, u, y = plain(m)
    return table(
        ("t", "u", "y"), ([f"{c} s" for c in time], [f"{c} V" for c in u], [f"{c} um" for c in y]), ";"
    )


def switched(words: tuple[str, str]) -> Content:
    def make(m: Measurement) -> str:
        time, _, y = plain(m)
        return table(("t_s", "heater", "room_degC"), (time, [words[int(u)] for u in m.u[:, 0]], y))

    return make


def footer(m: Measurement) -> str:
    below = ("", f"Samples;{len(m.t)};", f"Mean;;{m.y.mean():.4f}", "End of measurement;;")
    return table(("t_s", "u_V", "y_um"), plain(m), ";", below=below)


def repeated_header(m: Measurement) -> str:
    """Return a table that begins again after a restart of the logger, 40 samples later."""
    columns = plain(m)
    header = ("t_s", "u_V", "y_um")
    parts = [tuple(column[part] for column in columns) for part in (slice(0, 700), slice(740, None))]
    return "".join(table(header, part) for part in parts)


def _put_words(columns: list[list[str]]) -> None:
    for row, word in ((100, "OL"), (333, "Bad Input"), (334, "No Data"), (700, "#DIV/0!"), (1010, "-1.#IND")):
        columns[-1][row] = word


def _put_codes(columns: list[list[str]]) -> None:
    for row in (150, 420, 421, 900):
        columns[-1][row] = "-9999"


def _put_input_codes(columns: list[list[str]]) -> None:
    for row in (150, 420, 421, 900):
        columns[1][row] = "-9999"


def _drop_rows(m: Measurement) -> str:
    kept = np.r_[0:520, 531 : len(m.t)]
    return table(("t_s", "u_V", "y_um"), [[column[row] for row in kept] for column in plain(m)])


def _jitter(m: Measurement) -> list[str]:
    return cells(m.t + 0.1 * m.dt * np.random.default_rng(3).uniform(-1.0, 1.0, len(m.t)), "{:.6f}")


def _repeat_row(columns: list[list[str]]) -> None:
    for column in columns:
        column.insert(600, column[600])


ONE, UNITS = ("u_V",), "t_s,u_V,y_um"

AWKWARD_RECORDS = (
    # Formats, separators, languages and clocks.
    AwkwardRecord("plain", "first order", "r.csv", text(simple(UNITS)), ONE, "y_um"),
    AwkwardRecord(
        "German Excel",
        "second order",
        "r.csv",
        text(simple("Zeit [s];Spannung [V];Weg [µm]", ";", mark=","), "cp1252"),
        ("Spannung [V]",),
        "Weg [µm]",
    ),
    AwkwardRecord("byte order mark", "square", "r.csv", text(simple(UNITS), "utf-8-sig"), ONE, "y_um"),
    AwkwardRecord(
        "UTF-16 and tabs", "bilinear", "r.txt", text(simple("t_s\tu_V\ty_um", "\t"), "utf-16"), ONE, "y_um"
    ),
    AwkwardRecord(
        "line for Excel",
        "cubic",
        "r.csv",
        text(simple("t_s;u_V;y_um", ";", mark=",", above=("sep=;",))),
        ONE,
        "y_um",
    ),
    AwkwardRecord(
        "French exponents",
        "first order",
        "r.csv",
        text(exponents, "latin-1"),
        ("Tension (V)",),
        "Débit (l/s)",
    ),
    AwkwardRecord(
        "Japanese",
        "dead time",
        "r.csv",
        text(simple("時間[s],電圧[V],変位[um]"), "shift_jis"),
        ("電圧[V]",),
        "変位[um]",
    ),
    AwkwardRecord(
        "Chinese",
        "square",
        "r.csv",
        text(simple("时间(s),电压(V),位移(um)"), "gb18030"),
        ("电压(V)",),
        "位移(um)",
    ),
    AwkwardRecord(
        "Russian",
        "second order",
        "r.csv",
        text(simple("Время, с;Напряжение, В;Давление, Па", ";", mark=","), "cp1251"),
        ("Напряжение, В",),
        "Давление, Па",
    ),
    AwkwardRecord(
        "ISO 8601 in UTC",
        "temperature",
        "r.csv",
        text(timed("timestamp,valve,room", lambda m: stamps(m, "%Y-%m-%dT%H:%M:%SZ"))),
        ("valve",),
        "room",
        60.0,
    ),
    AwkwardRecord(
        "end of summer time",
        "temperature",
        "r.csv",
        text(timed("timestamp,valve,room", summer_time)),
        ("valve",),
        "room",
        30.0,
    ),
    AwkwardRecord(
        "German dates",
        "first order",
        "r.csv",
        text(timed("Datum;u_V;y_um", lambda m: clock(m, "%d.%m.%Y %H:%M:%S,%f"), ";", ",")),
        ONE,
        "y_um",
    ),
    AwkwardRecord(
        "American dates",
        "cubic",
        "r.csv",
        text(timed("When,u_V,y_um", lambda m: stamps(m, "%m/%d/%Y %I:%M:%S.%f %p"))),
        ONE,
        "y_um",
    ),
    AwkwardRecord(
        "date and time",
        "bilinear",
        "r.csv",
        text(timed("Date,Time,u_V,y_um", lambda m: clock(m, "%d.%m.%Y,%H:%M:%S.%f"))),
        ONE,
        "y_um",
    ),
    AwkwardRecord(
        "time of day over midnight",
        "dead time",
        "r.csv",
        text(timed("Uhrzeit,u_V,y_um", midnight)),
        ONE,
        "y_um",
    ),
    AwkwardRecord(
        "milliseconds since 1970",
        "square",
        "r.csv",
        text(timed("timestamp,u_V,y_um", lambda m: [f"{1_764_000_000_000 + 1000 * t:.0f}" for t in m.t])),
        ONE,
        "y_um",
    ),
    AwkwardRecord(
        "microseconds",
        "second order",
        "r.csv",
        text(timed("Time (us),u_V,y_um", lambda m: [f"{1e6 * t:.0f}" for t in m.t])),
        ONE,
        "y_um",
        0.0005,
    ),
    AwkwardRecord(
        "thousands in the time",
        "first order",
        "r.csv",
        text(
            timed("t_ms;u_V;y_um", lambda m: [f"{1000 + 1000 * t:,.1f}".replace(",", "'") for t in m.t], ";")
        ),
        ONE,
        "y_um",
    ),
    AwkwardRecord("oscilloscope", "bilinear", "r.csv", text(oscilloscope), ("CH1",), "CH2"),
    AwkwardRecord("LabVIEW", "first order", "r.txt", text(labview), ONE, "y_um"),
    AwkwardRecord("rows of types and units", "square", "r.csv", text(desk), ("In/u",), "Out/y"),
    AwkwardRecord(
        "row of units",
        "two inputs",
        "r.csv",
        text(lambda m: table(("s", "kW", "l/min", "degC"), plain(m), above=("Time,P,Q,T",))),
        ("P", "Q"),
        "T",
    ),
    AwkwardRecord(
        "description in a spreadsheet",
        "cubic",
        "r.csv",
        text(simple("t_s;u_V;y_um", ";", mark=",", above=("Bench 3;;", "Operator;A. Bee;", ";;"))),
        ONE,
        "y_um",
    ),
    AwkwardRecord("CODESYS trace", "first order", "r.csv", text(codesys), ("GVL.u",), "GVL.y", 0.0506),
    AwkwardRecord(
        "without a header",
        "second order",
        "r.csv",
        text(lambda m: table((), plain(m)[1:])),
        ("c1",),
        "c2",
        given=("--set", "header=false", "--dt", "0.1"),
    ),
    AwkwardRecord(
        "properties in the first samples",
        "first order",
        "r.csv",
        text(properties),
        ("c4",),
        "c5",
        given=("--set", "header=false", "--set", "time=c3"),
    ),
    AwkwardRecord("fixed width", "square", "r.dat", text(fixed_width), ("Druck",), "Kraft"),
    AwkwardRecord(
        "text with the ending of Excel",
        "bilinear",
        "r.xls",
        text(simple("t_s\tu_V\ty_um", "\t")),
        ONE,
        "y_um",
    ),
    AwkwardRecord("text without an ending", "dead time", "trace", text(simple(UNITS)), ONE, "y_um"),
    AwkwardRecord(
        "comments",
        "cubic",
        "r.log",
        text(simple(UNITS, above=("# bench 3", "# gain: 2.5", "#"))),
        ONE,
        "y_um",
    ),
    AwkwardRecord("carriage returns", "first order", "r.csv", text(simple(UNITS, end="\r")), ONE, "y_um"),
    AwkwardRecord("counter and states", "second order", "r.csv", text(statuses), ("u [V]",), "y [um]"),
    AwkwardRecord(
        "gzip",
        "two inputs",
        "r.csv.gz",
        lambda path, m: path.write_bytes(gzip.compress(simple("t_s,u1_V,u2_V,y_um")(m).encode())),
        ("u1_V", "u2_V"),
        "y_um",
    ),
    AwkwardRecord("zip", "square", "r.zip", write_zip, ONE, "y_um"),
    AwkwardRecord("NumPy", "bilinear", "r.npz", single(write_npz), ONE, "y_um"),
    AwkwardRecord("MATLAB", "cubic", "r.mat", single(write_mat), ("run.u_V",), "run.y_um"),
    AwkwardRecord("workbook", "first order", "r.xlsx", single(write_workbook), ("u",), "y"),
    AwkwardRecord(
        "workbook with dates", "temperature", "r.xlsx", write_dated_workbook, ("Ventil",), "Temperatur", 10.0
    ),
    AwkwardRecord("HDF5", "dead time", "r.h5", single(write_hdf5), ONE, "y_um"),
    AwkwardRecord("Parquet", "square", "r.parquet", write_parquet, ONE, "y_um"),
    AwkwardRecord("TDMS", "second order", "r.tdms", single(write_tdms), ("u",), "y"),
    AwkwardRecord("MDF", "bilinear", "r.mf4", write_mdf, ("u",), "y"),
    # Gross errors, clocks, cells, and structures.
    AwkwardRecord("spikes", "first order", "r.csv", text(changed(UNITS, _spikes)), ONE, "y_um"),
    AwkwardRecord(
        "codes of missing values", "second order", "r.csv", text(worded(UNITS, _put_codes)), ONE, "y_um"
    ),
    AwkwardRecord("codes in an input", "square", "r.csv", text(worded(UNITS, _put_input_codes)), ONE, "y_um"),
    AwkwardRecord("stuck sensor", "first order", "r.csv", text(changed(UNITS, _stuck)), ONE, "y_um"),
    AwkwardRecord("clipped output", "second order", "r.csv", text(changed(UNITS, _clipped)), ONE, "y_um"),
    AwkwardRecord(
        "days of Excel",
        "temperature",
        "r.csv",
        text(timed("Time,valve,room", lambda m: [f"{45987.5 + t / 86400:.9f}" for t in m.t])),
        ("valve",),
        "room",
        60.0,
    ),
    AwkwardRecord(
        "days of MATLAB",
        "temperature",
        "r.csv",
        text(timed("time,valve,room", lambda m: [f"{740304.5 + t / 86400:.9f}" for t in m.t])),
        ("valve",),
        "room",
        60.0,
    ),
    AwkwardRecord("slow output with empty cells", "waves", "r.csv", text(empty_between), ONE, "y_um"),
    AwkwardRecord("slow output that is held", "waves", "r.csv", text(held_between), ONE, "y_um"),
    AwkwardRecord("outer join of two clocks", "waves", "r.csv", text(outer_join), ONE, "y_um"),
    AwkwardRecord("late column", "bilinear", "r.csv", text(late_column), ONE, "y_um"),
    AwkwardRecord(
        "static map of two inputs",
        "static map",
        "r.csv",
        text(simple("t_s,i_A,x_mm,F_N")),
        ("i_A", "x_mm"),
        "F_N",
    ),
    AwkwardRecord("battery", "battery", "r.csv", text(simple("t_s,i_A,v_V")), ("i_A",), "v_V", 1.0),
    AwkwardRecord("tank", "tank", "r.csv", text(simple("t_s,q_lps,h_m")), ("q_lps",), "h_m", 1.0),
    AwkwardRecord("units in cells", "first order", "r.csv", text(with_units), ("u",), "y"),
    AwkwardRecord("units of a dashboard", "temperature", "r.csv", text(grafana), ("valve",), "room", 1.0),
    AwkwardRecord(
        "ON and OFF", "thermostat", "r.csv", text(switched(("OFF", "ON"))), ("heater",), "room_degC", 10.0
    ),
    AwkwardRecord(
        "True and False",
        "thermostat",
        "r.csv",
        text(switched(("False", "True"))),
        ("heater",),
        "room_degC",
        10.0,
    ),
    AwkwardRecord("footer", "cubic", "r.csv", text(footer), ONE, "y_um"),
    AwkwardRecord("repeated header", "second order", "r.csv", text(repeated_header), ONE, "y_um"),
    AwkwardRecord(
        "European thousands",
        "first order",
        "r.csv",
        text(euro_thousands),
        ("Kraft [N]",),
        "Weg [um]",
        factor=1000.0,
    ),
    AwkwardRecord("words in cells", "square", "r.csv", text(worded(UNITS, _put_words)), ONE, "y_um"),
    AwkwardRecord("gap", "dead time", "r.csv", text(_drop_rows), ONE, "y_um"),
    AwkwardRecord("jitter", "first order", "r.csv", text(timed(UNITS, _jitter)), ONE, "y_um"),
    AwkwardRecord("repeated row", "bilinear", "r.csv", text(worded(UNITS, _repeat_row)), ONE, "y_um"),
    AwkwardRecord("newest first", "cubic", "r.csv", text(newest_first), ONE, "y_um"),
)
