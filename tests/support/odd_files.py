"""Forty good, odd and bad record files, and what reading them gives: a record, or words of the message."""

import gzip
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

SAMPLES = 60
K = np.arange(SAMPLES)
T, U, Y = K / 100, K % 7 - 3.0, K * K % 11 + 0.5
START = datetime(2026, 11, 22, 14, 5, 3, 250_000)

#: Columns of a file that is read: its input and its output.
PAIR = ("u_V", "y_um")


@dataclass(frozen=True)
class OddFile:
    """A file and its result.

    Attributes
    ----------
    name : str
        File name.
    write : callable
        Writes the file at a path.
    columns : tuple of str
        Input and output.
    options : mapping
        Arguments of `read_record`.
    words : tuple of str
        Words of the message; empty if the file is read as U and Y, at `dt`, with `units`.
    """

    title: str
    name: str
    write: Callable[[Path], Any]
    words: tuple[str, ...] = ()
    columns: tuple[str, str] = PAIR
    options: Mapping[str, Any] = field(default_factory=dict)
    dt: float = 0.01
    units: tuple[str, str] = ("V", "um")


def table(header="t_s,u_V,y_um", separator=",", times=None, mark=".", end="\n", above=(), number="{:.4f}"):
    """Return the text of a table of T, U and Y."""
    times = [f"{t:.4f}".replace(".", mark) for t in T] if times is None else times
    rows = [
        separator.join((time, *(number.format(value).replace(".", mark) for value in pair)))
        for time, *pair in zip(times, U, Y, strict=True)
    ]
    return end.join([*above, *([header] if header else []), *rows]) + end


def text(content, encoding="utf-8"):
    return lambda path: path.write_bytes(content.encode(encoding))


def stamps(form, step=0.01, start=START):
    return [(start + timedelta(seconds=step * int(k))).strftime(form) for k in K]


def without(content, *lines):
    return "".join(
        line for number, line in enumerate(content.splitlines(keepends=True), 1) if number not in lines
    )


def replaced(line, cell, column=1):
    rows = table().splitlines()
    cells = rows[line - 1].split(",")
    cells[column] = cell
    rows[line - 1] = ",".join(cells)
    return "\n".join(rows)


# Files of programs, with signals from time 0.


def write_npz(path, t=T, u=U, y=Y):
    np.savez(path, u_V=u, y_um=y, fs=1.0 / t[1])


def write_mat(path, t=T, u=U, y=Y):
    from scipy.io import savemat

    savemat(path, {"run": {"t": t, "u_V": u, "y_um": y}})


def write_workbook(path, t=T, u=U, y=Y):
    import openpyxl

    book = openpyxl.Workbook()
    book.active.title = "Notes"
    book.active.append(["Operator", "A. Bee"])
    sheet = book.create_sheet("Data")
    sheet.append(["Measured", START])
    sheet.append(["Time", "u", "y"])
    sheet.append(["s", "V", "um"])
    for row in zip(t.tolist(), u.tolist(), y.tolist(), strict=True):
        sheet.append(row)
    book.save(path)


def write_hdf5(path, t=T, u=U, y=Y):
    import h5py

    with h5py.File(path, "w") as file:
        group = file.create_group("bench/run 1")
        for name, values in (("t_s", t), ("u_V", u), ("y_um", y)):
            group.create_dataset(name, data=values, compression="gzip")
        file.create_group("empty")


def write_tdms(path, t=T, u=U, y=Y):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment(
            [
                ChannelObject("Bench", name, values, properties={"unit_string": unit, "wf_increment": t[1]})
                for name, values, unit in (("u", u, "Volts"), ("y", y, "um"))
            ]
        )


def write_gzip(path):
    path.write_bytes(gzip.compress(table().encode()))


def write_zip(*names):
    def write(path):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name in names:
                archive.writestr(name, table())

    return write


def write_bomb(path):
    """A zip archive of a few kilobytes that declares two gigabytes."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("r.csv", b"0" * 1000)
    content = path.read_bytes()
    path.write_bytes(content.replace((1000).to_bytes(4, "little"), (2**31).to_bytes(4, "little")))


#: Instruments write properties or a word into other columns of the first samples.
PROPERTIES = table(
    header="", times=[f"{('Interval,0.01', 'Points,60', ',')[min(k, 2)]},{t:.4f}" for k, t in enumerate(T)]
)
DESK = table(
    'path,"time","In/u","Out/y"',
    times=[f"{'' if k else 'trace_values'},{t:.4f}" for k, t in enumerate(T)],
).replace('Out/y"\n', 'Out/y"\ntype,"x","y","y"\nunit,"s","V","-"\n')
NAMELESS = table(header="")
GERMAN = table("Zeit [s];Spannung [V];Weg [um]", ";", mark=",")
INSTRUMENT = ("Model,MDO3024", "Firmware,1.26", "Interval,0.01", "Points,60", "Gain,1", "Zero,0", "")
LVM = (
    *("LabVIEW Measurement", "Writer_Version\t2", "***End_of_Header***", ""),
    *("Channels\t2", "Samples\t60\t60", "Delta_X\t0.01\t0.01", "***End_of_Header***"),
)

ODD_FILES = (
    # Files that are read.
    OddFile("plain", "r.csv", text(table())),
    OddFile(
        "no header",
        "r.csv",
        text(NAMELESS),
        columns=("c2", "c3"),
        options={"header": False, "dt": 0.01},
        units=("", ""),
    ),
    OddFile("given names", "r.csv", text(NAMELESS), options={"names": ("t_s", "u_V", "y_um")}),
    OddFile("byte order mark", "r.csv", text("\ufeff" + table())),
    OddFile("UTF-16", "r.txt", text(table("t_s\tu_V\ty_um", "\t"), "utf-16")),
    OddFile("German Excel", "r.csv", text(GERMAN, "cp1252"), columns=("Spannung [V]", "Weg [um]")),
    OddFile("line for Excel", "r.csv", text(table("t_s;u_V;y_um", ";", mark=",", above=("sep=;",)))),
    OddFile(
        "thousands",
        "r.csv",
        text(table("t_ms;u_V;y_um", ";", [f"{1000 + 10 * k:,.1f}".replace(",", "'") for k in K])),
    ),
    OddFile("time in brackets", "r.csv", text(table("Time (ms),u_V,y_um", times=[f"{10 * k}" for k in K]))),
    OddFile("time as a quotient", "r.csv", text(table("t/s,u/V,y/um")), columns=("u/V", "y/um")),
    OddFile("ISO 8601", "r.csv", text(table("timestamp,u_V,y_um", times=stamps("%Y-%m-%dT%H:%M:%S.%fZ")))),
    OddFile("German dates", "r.csv", text(table("Datum;u_V;y_um", ";", stamps("%d.%m.%Y %H:%M:%S,%f"), ","))),
    OddFile("American dates", "r.csv", text(table("When,u_V,y_um", times=stamps("%m/%d/%Y %I:%M:%S.%f %p")))),
    OddFile(
        "date and time", "r.csv", text(table("Date,Time,u_V,y_um", times=stamps("%d.%m.%Y,%H:%M:%S.%f")))
    ),
    OddFile("time of day", "r.csv", text(table("Uhrzeit,u_V,y_um", times=stamps("%H:%M:%S.%f")))),
    OddFile(
        "milliseconds since 1970",
        "r.csv",
        text(table("timestamp,u_V,y_um", times=[f"{1_764_000_000_000 + 10 * k}" for k in K])),
    ),
    OddFile(
        "oscilloscope",
        "r.csv",
        text(table("TIME,CH1,CH2", above=INSTRUMENT)),
        columns=("CH1", "CH2"),
        units=("", ""),
    ),
    OddFile(
        "row of units in words",
        "r.csv",
        text(table("second,Volt,um", above=("x-axis,1,2",))),
        columns=("1", "2"),
    ),
    OddFile("LabVIEW", "r.txt", text(table("X_Value\tu_V\ty_um\tComment", "\t", above=LVM))),
    OddFile(
        "description in a spreadsheet",
        "r.csv",
        text(table("t_s;u_V;y_um", ";", mark=",", above=("Bench 3;;", ";;"))),
    ),
    OddFile("rows of types and units", "r.csv", text(DESK), columns=("In/u", "Out/y"), units=("V", "")),
    OddFile(
        "properties in the first samples",
        "r.csv",
        text(PROPERTIES),
        columns=("c4", "c5"),
        options={"header": False, "time": "c3"},
        units=("", ""),
    ),
    OddFile(
        "quoted fields",
        "r.csv",
        text(table('"t_s","drive, left [V]","y_um"')),
        columns=("drive, left [V]", "y_um"),
    ),
    OddFile("gap that is filled", "r.csv", text(replaced(30, "")), options={"gaps": "interpolate"}),
    OddFile(
        "jitter with dt",
        "r.csv",
        text(table(times=[f"{t + 0.002 * (k % 3):.4f}" for k, t in enumerate(T)])),
        options={"dt": 0.01},
    ),
    OddFile("gzip", "r.csv.gz", write_gzip),
    OddFile("zip", "r.zip", write_zip("folder/r.csv", "readme.md", "__MACOSX/._r.csv")),
    OddFile("NumPy", "r.npz", write_npz),
    OddFile("MATLAB", "r.mat", write_mat, columns=("run.u_V", "run.y_um")),
    OddFile("workbook", "r.xlsx", write_workbook, columns=("u", "y")),
    OddFile("HDF5", "r.h5", write_hdf5),
    OddFile("TDMS", "r.tdms", write_tdms, columns=("u", "y")),
    # Files that are refused.
    OddFile("numbers without header", "r.csv", text(NAMELESS), ("r.csv, line 1", "header=False", "names=[")),
    OddFile("empty", "r.csv", text(""), ("r.csv is empty",)),
    OddFile(
        "text in a cell",
        "r.csv",
        text(replaced(14, "off")),
        ("r.csv, line 14, column u_V: 'off'", "correct the cell"),
    ),
    OddFile(
        "missing value", "r.csv", text(replaced(14, "")), ("r.csv, line 14, column u_V", 'gaps="interpolate"')
    ),
    OddFile(
        "gap",
        "r.csv",
        text(without(table(), 20, 21)),
        ("r.csv, line 20, column t_s", "a gap of 0.03", 'gaps="split"'),
    ),
    OddFile(
        "repeated stamp",
        "r.csv",
        text(replaced(14, "0.11", 0)),
        ("line 14, column t_s repeats", "resample=DT", "dt=DT"),
    ),
    OddFile(
        "uncertain dates",
        "r.csv",
        text(table("when,u_V,y_um", times=["03/04/2026"] * 30 + ["04/04/2026"] * 30)),
        ("r.csv, line 2, column when", 'dates="day-first"'),
    ),
    OddFile(
        "uncertain thousands",
        "r.csv",
        text(table("t_s\tu_V\ty_um", "\t", [f"{k},001" for k in range(1, 61)], number="{:.0f}")),
        ("line 2, column t_s (1,001)", "1001 or 1.001", "decimal="),
    ),
    OddFile(
        "several records", "r.zip", write_zip("a.csv", "b.csv"), ("r.zip contains 2 records, a.csv, b.csv",)
    ),
    OddFile("zip bomb", "r.zip", write_bomb, ("r.zip unpacks to more than 1 GiB", "take a part")),
    OddFile("unknown format", "r.docx", text("x"), ("r.docx", ".csv", ".xlsx", "export the record")),
    OddFile("not a workbook", "r.xlsx", text("t,u,y"), ("r.xlsx is not a workbook", "save it again")),
    OddFile(
        "unknown sheet",
        "r.xlsx",
        write_workbook,
        ("has no sheet Rest; its sheets are Notes, Data",),
        options={"sheet": "Rest"},
    ),
    OddFile(
        "unknown column",
        "r.csv",
        text(table()),
        ("r.csv has no column u_v", "Did you mean 'u_V'?"),
        columns=("u_v", "y_um"),
    ),
)
