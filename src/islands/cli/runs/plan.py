"""Run of ``islands diagnose --plan``: what an experiment could tell apart, and the decisive experiment."""

from pathlib import Path

import numpy as np

from islands.cli.console import output
from islands.diagnosis.planning.experiment_plan import DecisiveLimits, ExperimentPlan
from islands.diagnosis.planning.planned_input import InputForm, InputLimits, PlannedInput
from islands.errors import SettingsError, lookup
from islands.records.channel_names import parse_unit
from islands.records.dataset import Dataset
from islands.records.reading import read_dataset
from islands.records.reading.options import ReadingOptions
from islands.records.reading.row_range import parse_rows
from islands.records.writer import write_input
from islands.report.documents.diagnosis_json import as_json
from islands.report.documents.plan_json import plan_document
from islands.report.text.plan import plan_text
from islands.settings_schema import list_changes, setting, settings_class

#: Files of a plan.
PLAN, MATRIX, EXPERIMENT = "plan.json", "plan.svg", "experiment.csv"


@settings_class
class PlanOptions:
    """Settings of an experiment that is planned."""

    plan: bool = setting(False, "Before any data: which causes this input could tell apart.", daily=True)
    noise_std: float | None = setting(
        None, "White noise of the output in its unit; by default estimated, with its colour.", gt=0
    )
    separate: str | None = setting(
        None, "CAUSE,CAUSE: two causes that the plan separates; by default all that it can."
    )
    excitation: str | None = setting(
        None,
        "Input, if no record: multisine:LOW:HIGH, sweep:LOW:HIGH, sine:FREQUENCY, triangle:FREQUENCY (Hz), "
        "steps:HOLD (s).",
    )
    amplitude: float | None = setting(
        None, "Half of the range of inputs; by default that of the given input.", gt=0
    )
    rate: float | None = setting(
        None, "Largest rate of inputs, per second; by default that of the given input.", gt=0
    )
    duration: float | None = setting(
        None,
        "Duration of the decisive experiment; by default that of the given input.",
        gt=0,
        unit="s",
    )

    def __post_init__(self) -> None:
        if not self.plan and (given := list(list_changes(self))):
            raise SettingsError(f"{given[0]} is a setting of plans: add --plan")

    @property
    def pair(self) -> tuple[str, ...]:
        """Names of the causes to be separated."""
        return tuple(name.strip() for name in (self.separate or "").split(",") if name.strip())

    @property
    def limits(self) -> DecisiveLimits:
        """Limits of the decisive experiment."""
        return DecisiveLimits(self.amplitude, self.rate, self.duration)


def read_input(
    records: list[Path],
    inputs: list[str],
    output_column: str | None,
    dt: float | None,
    rows: str | None,
    reading: ReadingOptions,
    planning: PlanOptions,
) -> Dataset:
    """Read the planned input from a file, or make the described one.

    Raises
    ------
    SettingsError
        There is neither one file nor a description, or both.
    """
    if len(records) + (planning.excitation is not None) != 1:
        raise SettingsError(
            "a plan needs one input: give a file with an input column, or the settings excitation, amplitude "
            "and duration, and --dt"
        )
    if records:
        return read_dataset(
            *(records[0], inputs, output_column, dt, parse_rows(rows), True, reading, True),
        )
    return _make_described(inputs, output_column or "y", dt, planning)


def _make_described(
    inputs: list[str], output_column: str, dt: float | None, planning: PlanOptions
) -> Dataset:
    if dt is None or planning.amplitude is None or planning.duration is None:
        raise SettingsError("excitation also needs the settings amplitude and duration, and --dt")
    if len(inputs) != 1:
        raise SettingsError("excitation describes the input alone: channels need a record")
    limits = InputLimits(-planning.amplitude, planning.amplitude, planning.rate or np.inf)
    samples = round(planning.duration / dt)
    u = parse_excitation(planning.excitation or "").make(limits, dt, samples)
    return Dataset(
        u=u,
        y=np.full(samples, np.nan),
        dt=dt,
        input_names=tuple(inputs),
        output_name=output_column,
        input_units=(parse_unit(inputs[0]),),
        output_unit=parse_unit(output_column),
    )


def parse_excitation(text: str) -> PlannedInput:
    """Read the text of an excitation, such as ``steps:HOLD``.

    The others are ``multisine:LOW:HIGH``, ``sweep:LOW:HIGH``, ``sine:FREQUENCY`` and ``triangle:FREQUENCY``.

    Raises
    ------
    SettingsError
        The text has another form.
    """
    name, *given = text.split(":")
    form = lookup({str(each): each for each in InputForm}, name, "excitation")
    try:
        numbers = [float(number) for number in given]
        if min(numbers) <= 0.0:
            raise ValueError
        match form, numbers:
            case InputForm.MULTISINE | InputForm.SWEEP, (low, high):
                return PlannedInput(form, 1.0, high, low)
            case InputForm.SINE | InputForm.TRIANGLE, (frequency,):
                return PlannedInput(form, 1.0, frequency)
            case InputForm.STEPS, (hold,):
                return PlannedInput(form, 1.0, 1.0 / hold)
    except ValueError:
        pass
    raise SettingsError(
        f"excitation {text}: write multisine:LOW:HIGH, sweep:LOW:HIGH, sine:FREQUENCY or "
        "triangle:FREQUENCY in Hz, or steps:HOLD in s, with positive numbers"
    )


def write_plan(plan: ExperimentPlan, folder: Path) -> None:
    """Write a plan into a folder. The document is written last: if it exists, the folder is complete."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (PLAN, EXPERIMENT):
        (folder / name).unlink(missing_ok=True)
    from islands.report.figures.separability import draw_separability  # noqa: PLC0415 - matplotlib
    from islands.report.figures.style import save  # noqa: PLC0415

    save(draw_separability(plan.isolability), folder / MATRIX)
    if plan.decisive is not None:
        name = plan.record.input_names[0]
        write_input(plan.decisive.u, plan.decisive.dt, name, folder / EXPERIMENT)
    (folder / PLAN).write_text(as_json(plan_document(plan)))


def show_plan(plan: ExperimentPlan, folder: Path) -> None:
    """Print a plan and the files of its folder."""
    output.print(plan_text(plan), markup=False)
    output.print(f"{folder}/: {', '.join(path.name for path in sorted(folder.iterdir()))}", markup=False)
