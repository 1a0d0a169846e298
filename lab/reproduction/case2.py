"""Case 2 of the paper (sections 6.2 and 7): the measured micromanipulator at 5 V and 300 Hz.

The record ``h50us.csv`` is published by its owners and is not part of this project. Without it, a simulated
actuator takes its place, which the page says in every title.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from islands.errors import RecordError
from islands.records.dataset import Dataset, same_dt
from islands.records.reading import fingerprint, preview, read_dataset
from islands.records.reading.options import ReadingOptions
from islands.simulation.predictors import free_run
from islands.systems.bouc_wen import BoucWenPiezo, simulate
from islands.systems.published_models import PUBLISHED
from islands.systems.signals import hold_signal, sine
from lab.reproduction.figures import Reproduced, draw_training_data, draw_validation
from lab.reproduction.published import (
    assess_published,
    explain_error,
    explain_parameter,
    format_error,
)
from lab.reproduction.searches import read_document
from lab.reproduction.section import WHY, ComparisonTable, Section, SectionFigure
from lab.reproduction.tasks import Document, ReproductionOptions, Task

#: Sampling time, amplitude and frequency of section 6.2.
DT, AMPLITUDE, FREQUENCY = 5e-5, 5.0, 300.0

#: Columns of the owners' file, and of the record of the same rig at 150 V and 1 Hz.
COLUMNS = ("index", "t_s", "y_um", "u_V")
SAME_RIG = ("t_s", "y_um", "u_V")

#: Seconds at the start of the 150 V record in which the rig is at rest.
_AT_REST = 5.0

#: Samples of the simulated record: half a second, in the short form a tenth.
_SAMPLES, _QUICK_SAMPLES = 10_000, 2_000

#: Actuator in place of the measured one: that of case 1 with 8 times the displacement per volt, which gives
#: the range of model (14), and the loop of case 1 at an eighth of its voltage.
SUBSTITUTE = BoucWenPiezo(A=7.2, beta=0.064, gamma=0.064, dp=12.8)

#: Standard deviation in um of its noise: the resolution of the optical sensors, 10 nm.
_RESOLUTION = 0.01

#: Samples until its loop repeats: ten periods.
_TRANSIENT = 667

#: Standard deviation in V of the noise of its amplifier, which drives the actuator. With an exact sine as the
#: input, the three linear input terms of (14) would be linearly dependent.
_AMPLIFIER_NOISE = 1e-3

_DRAWS, _QUICK_DRAWS = 200, 20

#: Level of the constant input as a fraction of the amplitude, and periods of the sine before and after.
_LEVEL, _PERIODS = 0.5, 3


@dataclass(frozen=True, slots=True)
class Case2Record:
    """The record of case 2.

    Attributes
    ----------
    record : Dataset
        Without means and without the drift of the output.
    source : str
        Description for the titles of the page.
    simulated : bool
        Whether it is the simulated record.
    """

    record: Dataset
    source: str
    simulated: bool = False

    @property
    def halves(self) -> dict[str, Dataset]:
        """Estimation data and validation data: the first and the second half of the record."""
        middle = self.record.samples // 2
        return {"estimation": self.record[:middle], "validation": self.record[middle:]}


def plan(options: ReproductionOptions) -> list[Task]:
    """Return the task of case 2; it depends on the content of the file.

    Raises
    ------
    RecordError
        The file cannot be read.
    """
    content = fingerprint(Path(options.data)) if options.data else ""
    return [Task("case2-published", assess_model, (options.data, content, options.quick))]


def assess_model(data: str, _content: str, quick: bool) -> Document:
    """Return the errors and parameters of model (14) on the record, as printed and estimated again."""
    taken = take_record(data, quick)
    # The printed parameters hold for one sampling time.
    printed = same_dt(taken.record.dt, DT)
    published = PUBLISHED["14"]
    draws = _QUICK_DRAWS if quick else _DRAWS
    found = assess_published(published, taken.halves, draws, printed=printed)
    return {**found, "samples": taken.record.samples, "dt": taken.record.dt}


def take_record(data: str, quick: bool) -> Case2Record:
    """Read the measured record, or simulate the one in its place.

    Parameters
    ----------
    data : str
        File with the columns of the owners, or of the record at 150 V and 1 Hz; empty to simulate one.
    quick : bool
        Whether the simulated record is short. A measured record is taken as a whole.

    Raises
    ------
    RecordError
        The file cannot be read, or has another number of columns.
    """
    if not data:
        simulated = simulate_substitute(_QUICK_SAMPLES if quick else _SAMPLES)
        return Case2Record(
            remove_drift(simulated), "simulated in place of the measured record", simulated=True
        )
    name = Path(data).name
    if (record := _read(data, COLUMNS)) is not None:
        return Case2Record(remove_drift(record), f"measured: {name}")
    if (record := _read(data, SAME_RIG)) is not None:
        moving = record[int(np.searchsorted(record.time, _AT_REST, side="right")) :]
        return Case2Record(remove_drift(moving), f"measured, the same rig in another test: {name}")
    raise RecordError(
        f"{data} has other columns: the owners' file has {len(COLUMNS)} (index, time, output, input), the "
        f"record at 150 V and 1 Hz has {len(SAME_RIG)} (time, output, input)"
    )


def _read(data: str, names: tuple[str, ...]) -> Dataset | None:
    """Read a file, with or without a header, whose columns have an order; None if it has another number."""
    try:
        preview(data, ReadingOptions(names=names))
    except RecordError:
        return None
    return read_dataset(data, ["u_V"], "y_um", options=ReadingOptions(names=names))


def remove_drift(record: Dataset) -> Dataset:
    """Subtract the mean of the input, and the mean and a straight line from the output.

    The line is fitted together with the input and its slope: a few periods of a sine would tilt a line that
    is fitted alone.
    """
    u, t = record.u[:, 0] - record.u[:, 0].mean(), record.time - record.time.mean()
    columns = np.column_stack([np.ones_like(t), t, u, np.gradient(u)])
    scale = np.abs(columns).max(axis=0)
    offset, slope, *_ = np.linalg.lstsq(columns / scale, record.y)[0] / scale
    return replace(record, u=u[:, None], y=record.y - offset - slope * t)


def simulate_substitute(samples: int) -> Dataset:
    """Simulate the actuator in place of the measured one, with noise of the resolution of its sensors."""
    rng = np.random.default_rng(0)
    whole = _TRANSIENT + samples
    u = sine(DT, whole * DT, AMPLITUDE, FREQUENCY) + _AMPLIFIER_NOISE * rng.standard_normal(whole)
    y = simulate(SUBSTITUTE, u, DT) + _RESOLUTION * rng.standard_normal(whole)
    return Dataset(u, y, DT, ("u_V",), "y_um", ("V",), "um")[_TRANSIENT:]


def summarise(results: Mapping[str, Document], options: ReproductionOptions) -> Section:
    """Compare the results of the tasks with the paper.

    Parameters
    ----------
    results : mapping
        Results of the tasks of `plan` by key.
    options : ReproductionOptions
    """
    document = results["case2-published"]
    taken = take_record(options.data, options.quick)
    return Section(
        f"Case 2: micromanipulator ({taken.source})",
        _introduce(taken, document),
        (_tabulate_errors(document, taken), _tabulate_parameters(document, taken)),
        (
            SectionFigure(
                "figure-4b", f"Figure 4 (b): training data; {taken.source}", partial(_draw_data, taken)
            ),
            SectionFigure(
                "figure-6",
                f"Figure 6: free run of (14), estimated again; {taken.source}. "
                + (
                    "System: the simulated actuator"
                    if taken.simulated
                    else "The output at constant input was not measured"
                ),
                partial(_draw_validation, taken, document["model"]),
            ),
        ),
        {"published": document},
    )


def _introduce(taken: Case2Record, document: Document) -> tuple[str, ...]:
    record = (
        f"The record has {document['samples']} samples of {1e6 * document['dt']:.4g} us, without means and "
        "without the drift of the output; its first half is the estimation data, its second half the "
        "validation data."
    )
    if not taken.simulated:
        return (record,)
    substitute = (
        "The measured record of the paper, h50us.csv, is published by its owners and is not part of this "
        "project: download it and repeat the command with --data h50us.csv. Until then, the numbers below "
        "are those of a simulated actuator: the piezo of case 1, scaled to 5 V and to the range of model "
        "(14), at 300 Hz, with noise of 10 nm. They are no reproduction of the measured record."
    )
    return substitute, record


def _tabulate_errors(document: Document, taken: Case2Record) -> ComparisonTable:
    entry = PUBLISHED["14"]
    rows = []
    for metric, printed, name in (("mape", entry.mape, "MAPE %"), ("r2", entry.r2, "R2")):
        for value, record in zip(printed, ("estimation", "validation"), strict=True):
            computed = document["printed"][record][metric] if "printed" in document else None
            estimated = document["estimated"][record][metric]
            rows.append(
                (
                    f"(14), {name}, {record}",
                    f"{value:.5f}",
                    format_error(computed) if "printed" in document else "-",
                    format_error(estimated),
                    _name_difference(document, taken) + explain_error(value, document, record, metric),
                )
            )
    columns = ("quantity", "published", "here, as printed", "here, estimated again", WHY)
    return ComparisonTable(f"Table 1, model (14): free-run errors; {taken.source}", tuple(rows), columns)


def _name_difference(document: Document, taken: Case2Record) -> str:
    """Name the difference between this record and that of the paper; empty for the record of the paper."""
    if taken.simulated:
        return "Another system: the record is simulated. "
    if "printed" not in document:
        return f"Another record, {1e6 * document['dt']:.4g} us: the printed parameters do not hold for it. "
    return ""


def _tabulate_parameters(document: Document, taken: Case2Record) -> ComparisonTable:
    rows = [
        (
            f"(14) θ{position}: {row['term']}",
            f"{row['printed']:.3g}",
            f"{row['estimated']:.4g}",
            _name_difference(document, taken) + explain_parameter(row),
        )
        for position, row in enumerate(document["parameters"], start=1)
    ]
    return ComparisonTable(f"Table 2, model (14), by constrained least squares; {taken.source}", tuple(rows))


def _draw_data(taken: Case2Record, theme: str) -> Figure:
    record = taken.record
    return draw_training_data(record[: 5 * _find_period(record)], theme)


def _draw_validation(taken: Case2Record, model_terms: Document, theme: str) -> Figure:
    record = taken.halves["validation"]
    model, period = read_document(model_terms, record), _find_period(record)
    amplitude = float(np.ptp(record.u)) / 2

    def hold(loading: bool) -> Reproduced:
        u = hold_signal(
            record.dt,
            _PERIODS * period * record.dt,
            amplitude=amplitude,
            frequency=1.0 / (period * record.dt),
            level=_LEVEL * amplitude,
            loading=loading,
        )
        if taken.simulated:
            y = simulate(SUBSTITUTE, u, record.dt)
        else:
            # Only the start is known: that of the record where its input is nearest to zero.
            y = np.full(len(u), np.nan)
            y[: model.maximum_lag] = record.y[int(np.argmin(np.abs(record.u[:, 0])))]
        held = Dataset(
            u, y, record.dt, record.input_names, record.output_name, record.input_units, record.output_unit
        )
        return Reproduced(held, free_run(model, held).y)

    shown = Reproduced(record, free_run(model, record).y)
    return draw_validation(shown[: 3 * period], hold(True), hold(False), theme)


def _find_period(record: Dataset) -> int:
    """Return the period of the input in samples, from its crossings of zero in one direction."""
    u = record.u[:, 0]
    rising = np.flatnonzero((u[:-1] < 0.0) & (u[1:] >= 0.0))
    if len(rising) < 2:
        raise RecordError("the input of the record has no two periods: give the record of a sine")
    return round((int(rising[-1]) - int(rising[0])) / (len(rising) - 1))
