"""`DiagnosisResult`: sentences, files, figures and extended simulation of a diagnosis."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from datetime import date
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from islands.diagnosis.detectability import SelfTest
from islands.diagnosis.findings import ResidualFormula
from islands.diagnosis.result import Diagnosis
from islands.errors import ModelError, lookup
from islands.facade.results.notebook_html import render_sentences
from islands.facade.results.saved_simulation import SavedSimulation
from islands.parallel import ParallelMap
from islands.persistence.checkpoints import replace_file
from islands.progress import Steps
from islands.records.writer import input_csv
from islands.report.documents.diagnosis_json import as_json, diagnosis_document
from islands.report.documents.extension import extended_document, extended_json
from islands.report.documents.plan_json import NEXT_EXPERIMENT_FILE, get_suggested_input
from islands.report.pages.origin import REPORT_FILE, Origin
from islands.report.text.statements import describe_diagnosis
from islands.simulation.predictors import Simulation
from islands.simulators.specification.table import EXTENDED_FILE, LocalExtendedSpec

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from islands.records.reading.data_frames import RecordLike

#: Document of a folder.
DIAGNOSIS_FILE = "discrepancy.json"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DiagnosisResult(Diagnosis):
    """Result of `diagnose`: a `Diagnosis` and what was computed after it.

    Attributes
    ----------
    formula : ResidualFormula or None
        Formula of the unexplained residual; see `explain_residual`.
    tested : SelfTest or None
        Detection limits and false-alarm rate on the record; see ``lab/diagnosis/self_test.py``.
    wall_s : float or None
        Duration in seconds; None if it was not measured.
    """

    formula: ResidualFormula | None = None
    tested: SelfTest | None = None
    wall_s: float | None = None

    @classmethod
    def from_diagnosis(
        cls,
        found: Diagnosis,
        formula: ResidualFormula | None = None,
        tested: SelfTest | None = None,
        wall_s: float | None = None,
    ) -> "DiagnosisResult":
        """Return the result of a diagnosis."""
        values = {each.name: getattr(found, each.name) for each in fields(Diagnosis)}
        return cls(**values, formula=formula, tested=tested, wall_s=wall_s)

    def with_steps(self, steps: Steps) -> "DiagnosisResult":
        """Return a copy that states the steps after the diagnosis that were left out, or failed."""
        return replace(
            self,
            left_out=(*self.left_out, *steps.left_out),
            not_computed={**self.not_computed, **steps.not_computed},
        )

    @property
    def summary(self) -> str:
        """Verdict, causes, gain and next experiment as sentences."""
        return "\n".join(describe_diagnosis(self.document))

    @property
    def document(self) -> dict[str, Any]:
        """Content of ``discrepancy.json``."""
        return diagnosis_document(self, self.wall_s, self.tested, self.formula)

    @property
    def extended_document(self) -> str | None:
        """Text of ``extended.json``, the extended simulation; None if there is none, or it is refused."""
        if self.gain is None or self.refusal:
            return None
        return extended_json(self.best, self.record)

    @property
    def next_input(self) -> str | None:
        """Text of ``next-experiment.csv``: time in seconds, and the input of the next experiment.

        The column of the input has its name in the record, so that the new record is read with the same
        options. None if there is no such input, or if the record separates all causes.
        """
        experiment = self.next_experiment
        designed = None if experiment is None else get_suggested_input(experiment)
        if designed is None:
            return None
        return input_csv(designed.u, designed.dt, designed.name)

    def write_report(self, origin: Origin, parallel_map: ParallelMap = map) -> bytes:
        """Return ``report.html``, with the name of the record: sentences, numbers and figures."""
        from islands.report.pages.diagnosis import diagnosis_report  # noqa: PLC0415 - many results have no report

        return diagnosis_report(origin, self, self.tested, self.formula, parallel_map)

    def save(
        self,
        folder: str | Path,
        name: str = "record",
        steps: Steps | None = None,
        parallel_map: ParallelMap = map,
        day: date | None = None,
    ) -> Path:
        """Write ``discrepancy.json``, ``report.html``, and the simulation and the input that were found.

        ``extended.json`` is written if an effect was added, and ``next-experiment.csv`` if an input separates
        causes that the record does not tell apart.

        Parameters
        ----------
        folder : str or Path
            Files of an earlier diagnosis in it are replaced; `islands.load` opens it.
        name : str
            Name of the record in the report.
        steps : Steps, optional
            All files but the document are optional steps; a stop request leaves the report out. The document
            names the steps that were left out, and those that failed.
        parallel_map : ParallelMap
            Draws the figures of the report, which does not depend on it.
        day : date, optional
            Day of the diagnosis, for the report.
        """
        folder, steps = Path(folder), steps or Steps()
        folder.mkdir(parents=True, exist_ok=True)
        for file in (EXTENDED_FILE, NEXT_EXPERIMENT_FILE, DIAGNOSIS_FILE, REPORT_FILE):
            (folder / file).unlink(missing_ok=True)
        self._write_document(folder)
        brief = Steps()  # a stop request does not leave these out
        texts = {EXTENDED_FILE: "extended_document", NEXT_EXPERIMENT_FILE: "next_input"}
        for file, attribute in texts.items():
            text = brief.attempt(file, partial(getattr, self, attribute))
            if text is not None:
                (folder / file).write_text(text, encoding="utf-8")
        report = steps.attempt(REPORT_FILE, partial(self.write_report, Origin(name, day), parallel_map))
        if report is not None:
            (folder / REPORT_FILE).write_bytes(report)
        complete = self.with_steps(steps).with_steps(brief)
        if complete.left_out or complete.not_computed:
            complete._write_document(folder)
        return folder

    def _write_document(self, folder: Path) -> None:
        replace_file([as_json(self.document).encode()], folder / DIAGNOSIS_FILE)

    def plot(self, kind: str = "over-time") -> "Figure":
        """Draw a figure of the report.

        Parameters
        ----------
        kind : str
            A key of ``islands.report.figures.diagnosis.DIAGNOSIS_FIGURES``: ``over-time``, ``loops``,
            ``residual`` or ``ladder``.

        Raises
        ------
        SettingsError
            There is no such figure.
        """
        from islands.report.figures.diagnosis import DIAGNOSIS_FIGURES  # noqa: PLC0415 - matplotlib

        return lookup(DIAGNOSIS_FIGURES, kind, "figure")(self)

    @property
    def extension(self) -> SavedSimulation:
        """The extended simulation.

        Raises
        ------
        ModelError
            The diagnosis added no effect to the simulation, or the extended simulation may diverge.
        """
        if self.refusal:
            name = self.base.simulation.simulator.name
            raise ModelError(f"{self.refusal} Simulate what was diagnosed, {name}")
        if self.gain is None:
            raise ModelError(
                f"there is no extended simulation, because the verdict of the diagnosis is "
                f"{str(self.verdict)!r}: simulate what was diagnosed, {self.base.simulation.simulator.name}"
            )
        return SavedSimulation(LocalExtendedSpec.model_validate(extended_document(self.best, self.record)))

    def simulate(self, record: "RecordLike", columns: Mapping[str, NDArray[Any]] | None = None) -> Simulation:
        """Simulate a record with the extended simulation; see `SavedSimulation.simulate`."""
        return self.extension.simulate(record, columns)

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the extended simulation as text, or write it; see `SavedSimulation.export`."""
        return self.extension.export(kind, path)

    def __str__(self) -> str:
        return self.summary

    def __repr__(self) -> str:
        causes = ", ".join(self.claimed_names) or "no causes"
        return f"<DiagnosisResult {str(self.verdict)!r}: {causes}>"

    def _repr_html_(self) -> str:
        return render_sentences(self.summary.splitlines(), self.plot(), "measured and simulated output")
