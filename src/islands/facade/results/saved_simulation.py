"""Simulations of files: differential equations, an FMU, and the extended simulation of a diagnosis."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from islands.errors import ModelError
from islands.export import FILE_EXPORTS, export_or_write
from islands.export.closed_form import closed_form
from islands.facade.results.model_simulation import simulate
from islands.facade.results.notebook_html import render_sentences
from islands.records.dataset import Dataset
from islands.records.reading.data_frames import as_dataset
from islands.report.text.statements import describe_diagnosis
from islands.simulation.predictors import Simulation
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.table import ColumnSpec, LocalExtendedSpec, innermost

if TYPE_CHECKING:
    from islands.records.reading.data_frames import RecordLike


@dataclass(frozen=True, slots=True)
class SavedSimulation:
    """A simulation of a file.

    Attributes
    ----------
    spec : LocalExtendedSpec, OdeSpec or FmuSpec
        An extended simulation, differential equations or an FMU.
    """

    spec: LocalExtendedSpec | OdeSpec | FmuSpec

    @property
    def column_names(self) -> tuple[str, ...]:
        """Names of the inputs."""
        if isinstance(self.spec, LocalExtendedSpec):
            return self.spec.inputs
        return (self.spec.input, *self.spec.channels)

    @property
    def output_name(self) -> str:
        """Name of the output."""
        return self.spec.output

    @property
    def recorded_columns(self) -> tuple[str, ...]:
        """Name of the column of a record whose simulation is extended; empty for all other simulations."""
        inner = innermost(self.spec)
        return (inner.column,) if isinstance(inner, ColumnSpec) else ()

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the effects that extend the simulation, or the name of the simulation itself."""
        if not isinstance(self.spec, LocalExtendedSpec):
            return (self.spec.name,)
        effects = tuple(effect.name for effect in self.spec.effects)
        return effects if self.spec.output_equation is None else (*effects, "missing terms")

    def simulate(self, record: "RecordLike", columns: Mapping[str, NDArray[Any]] | None = None) -> Simulation:
        """Simulate a record; initial states are fitted to its measured output.

        Parameters
        ----------
        record : Dataset or data frame
            A frame has the columns of the simulation.
        columns : mapping, optional
            Recorded simulations by name, each of shape (samples,), for `recorded_columns`.

        Raises
        ------
        RecordError
            The record does not match the simulation.
        """
        if not isinstance(record, Dataset):
            record = as_dataset(record, inputs=self.column_names, output=self.output_name)
        return simulate(self.spec, record, columns=columns)

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return an extended simulation as text, or write it to a file; see `export_extended`.

        Parameters
        ----------
        kind : str
            plain, python, c, matlab or json; with a closed form also every format of a model.
        path : str or Path, optional
            File to write; nothing is returned then.

        Raises
        ------
        SettingsError
            The format is unknown, or is not text and no path is given.
        ModelError
            The simulation cannot be written in this format, or is no extended simulation.
        """
        if not isinstance(self.spec, LocalExtendedSpec):
            raise ModelError(
                f"{self.spec.name} is a simulation that was not diagnosed: give a model or an extended.json"
            )
        if kind in FILE_EXPORTS:
            return export_or_write(closed_form(self.spec), kind, path)
        # The generators of programs import all simulators, which a model or a result does not need.
        from islands.export.extension import export_extended  # noqa: PLC0415

        text = export_extended(self.spec, kind)
        if path is None:
            return text
        Path(path).write_text(f"{text.rstrip()}\n", encoding="utf-8")
        return None


@dataclass(frozen=True, slots=True)
class SavedDiagnosis:
    """Diagnosis of a folder.

    Attributes
    ----------
    folder : Path
    document : mapping
        Content of ``discrepancy.json``: verdict, effects, gain, findings about the record.
    extension : SavedSimulation or None
        The extended simulation; None if the diagnosis added no effect.
    """

    folder: Path
    document: Mapping[str, Any]
    extension: SavedSimulation | None

    @property
    def verdict(self) -> str:
        """Verdict of the diagnosis."""
        return str(self.document["verdict"])

    @property
    def summary(self) -> str:
        """Verdict, causes, gain and next experiment as sentences, which are those of the run."""
        return "\n".join(describe_diagnosis(self.document))

    @property
    def next_experiment(self) -> Mapping[str, Any] | None:
        """Experiment that separates causes which the record does not tell apart; None if there are none.

        Its ``input`` has limits, sampling time and name of ``file``, which is in the folder.
        """
        found: Mapping[str, Any] | None = self.document.get("next_experiment")
        return found

    def __str__(self) -> str:
        return self.summary

    def _repr_html_(self) -> str:
        return render_sentences(self.summary.splitlines(), None, "")

    def require_extension(self) -> SavedSimulation:
        """Return the extended simulation.

        Raises
        ------
        ModelError
            The diagnosis added no effect to the simulation, or the extended simulation may diverge.
        """
        if self.extension is None and (refusal := (self.document.get("extension") or {}).get("refusal")):
            raise ModelError(f"{refusal} Simulate what was diagnosed, {self.document.get('simulation')}")
        if self.extension is None:
            raise ModelError(
                f"{self.folder} has no extended simulation, because the verdict of the diagnosis is "
                f"{self.verdict!r}: simulate what was diagnosed, {self.document.get('simulation')}"
            )
        return self.extension

    def simulate(self, record: "RecordLike", columns: Mapping[str, NDArray[Any]] | None = None) -> Simulation:
        """Simulate a record with the extended simulation; see `SavedSimulation.simulate`."""
        return self.require_extension().simulate(record, columns)

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the extended simulation as text, or write it; see `SavedSimulation.export`."""
        return self.require_extension().export(kind, path)
