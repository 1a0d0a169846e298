"""Result of an identification of several outputs."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from islands.errors import ModelError, SettingsError
from islands.export import export_or_write
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.facade.results.identification import Result, list_errors
from islands.facade.results.model_analysis import linearise
from islands.facade.results.model_simulation import coupled_record_of_model, hold_predictions
from islands.facade.results.notebook_html import render_sentences
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.coupled_narx import CoupledModel, coupled_signals
from islands.models.state_space import StateSpace
from islands.persistence.checkpoints import replace_file
from islands.persistence.ensembles import (
    bands_document,
    bands_from_document,
    ensemble_document,
    ensemble_from_document,
)
from islands.persistence.models import model_json
from islands.progress import Steps
from islands.records.coupled import CoupledRecord, CoupledSplit, match_coupled
from islands.records.inspection.noise import measure_output_noise
from islands.records.signal_map import match_rate
from islands.records.split import measure_input_ranges
from islands.report.documents.result_folder import (
    finite,
    list_failures,
    measure_left_out,
    record_document,
    residual_structure_document,
    terms_in_result,
)
from islands.report.figures.names import FREE_RUN, OVERVIEW
from islands.report.pages.origin import REPORT_FILE
from islands.report.text.layout import term_table, wrap
from islands.report.text.statements import describe_coupled
from islands.simulation.input_response import simulate_inputs
from islands.simulation.predictors import Simulation, free_run, one_step_ahead
from islands.simulation.stepper import Stepper
from islands.validation.ensemble import Ensemble
from islands.validation.metrics import Metrics, metrics
from islands.validation.predictable_residual import (
    ResidualStructure,
    measure_structure,
    missing_structure,
)
from islands.validation.prediction_bands import LEVEL, PredictionBand, PredictionBands

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from islands.models.linearisation import OperatingPoint
    from islands.records.reading.data_frames import RecordLike

#: Errors by output, part and prediction.
_Metrics: TypeAlias = Mapping[str, Mapping[str, Mapping[str, Metrics]]]

COUPLED_RESULT_SCHEMA = "islands.coupled-result/1"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FittedCoupledModel:
    """Model of several outputs, of a result or of a file.

    Attributes
    ----------
    model : CoupledModel
        Equations of all outputs.
    warm_up : int
        Number of samples before the first prediction. The errors depend on it.
    prediction_bands : tuple of PredictionBands
        Prediction bands of every output. Empty if the free run of the model diverged, the search was stopped
        before them, or outside of a result folder.
    """

    model: CoupledModel
    warm_up: int
    prediction_bands: tuple[PredictionBands, ...]

    @property
    def equation(self) -> str:
        """Equations with the column names of the record, one line per output."""
        return self.model.equation().named

    def simulate(
        self,
        record: "RecordLike | CoupledRecord",
        warm_up: int | None = None,
        y: Sequence[float] | None = None,
        states: Sequence[float] | None = None,
    ) -> Simulation:
        """Simulate all outputs of a record from its first samples, or inputs alone from rest.

        Parameters
        ----------
        record : CoupledRecord, Dataset, data frame or array
            Its samples are averaged as those of the search. Without any output, as in an array of inputs, the
            model is simulated from rest at the first inputs.
        warm_up : int, optional
            Number of samples before the first prediction; by default that of the errors of the result.
        y, states
            Outputs before the first sample, or states of a latent model at the first sample, from which to
            start in place of the measured outputs.
        """
        data = coupled_record_of_model(self.model, record)
        if y is None and states is None and np.isfinite(data.y).any():
            return free_run(self.model, data, self.warm_up if warm_up is None else warm_up)
        return simulate_inputs(self.model, data.map(lambda each: match_rate(self.model, each)), y, states)

    def predict(self, record: "RecordLike | CoupledRecord") -> NDArray[np.float64]:
        """Return the free run of all outputs, one row for every row of the data, shape (samples, outputs).

        It starts from the first samples of the outputs, as many as the largest lag of the model, or from rest
        without any output. NaN before the first prediction and after a divergence.
        """
        measured = coupled_record_of_model(self.model, record)
        data = measured.map(lambda each: match_rate(self.model, each))
        found = self.simulate(data, self.model.maximum_lag).y
        is_same = all(one is other for one, other in zip(measured.records, data.records, strict=True))
        return found if is_same else hold_predictions(measured, data, found)

    def stepper(
        self,
        u: "OperatingPoint | None" = None,
        y: Sequence[float] | None = None,
        states: Sequence[float] | None = None,
    ) -> Stepper:
        """Return a simulation of one sample at a time; see `FittedModel.stepper`."""
        return Stepper(self.model, u, y, states)

    def bands(
        self, record: "RecordLike | CoupledRecord", level: float = LEVEL, warm_up: int | None = None
    ) -> tuple[PredictionBand, ...]:
        """Simulate all outputs of a record, each with a band that contains its measured samples.

        Parameters
        ----------
        record, warm_up
            As for `simulate`.
        level : float
            Probability with which a band contains a measured sample, between 0.5 and 0.99.

        Returns
        -------
        tuple of PredictionBand
            One for each output.

        Raises
        ------
        ModelError
            The model has no bands.
        SettingsError
            The level is out of range.
        """
        if not self.prediction_bands:
            raise ModelError(
                "the model has no prediction bands: it is not of a result folder, its free run diverges, or "
                "the search was stopped before them"
            )
        first = self.warm_up if warm_up is None else warm_up
        measured = coupled_record_of_model(self.model, record)
        data = match_coupled(self.model, measured.map(lambda each: match_rate(self.model, each)))
        run = free_run(self.model, data, first).y
        runs = self._simulate_ensembles(data, first)
        return tuple(
            each.band(data.records[place], run[:, place], runs[place], level)
            for place, each in enumerate(self.prediction_bands)
        )

    def linearise(
        self, operating_point: "OperatingPoint | None" = None, y: "ArrayLike | None" = None
    ) -> StateSpace:
        """Linearise the model, with the uncertainty of its ensemble; see `islands.linearise`."""
        return linearise(self.model, operating_point, y, self._shared_ensemble)

    def plot_linear(
        self,
        kind: str = "bode",
        operating_point: "OperatingPoint | None" = None,
        y: "ArrayLike | None" = None,
    ) -> "Figure":
        """Draw the linear system of the model about an operating point; see `FittedModel.plot_linear`."""
        from islands.report.figures.linear_system import draw_linear_system  # noqa: PLC0415 - matplotlib

        return draw_linear_system(self.linearise(operating_point, y), kind)

    @property
    def _shared_ensemble(self) -> Ensemble | None:
        """The ensemble of all outputs; None without bands, or if every output has its own."""
        found = [each.ensemble for each in self.prediction_bands]
        return found[0] if found and all(each is found[0] for each in found) else None

    def _simulate_ensembles(self, data: CoupledRecord, warm_up: int) -> list[NDArray[np.float64]]:
        """Return the free runs of the ensemble of every output, each of shape (members, samples)."""
        shared = self._shared_ensemble
        if shared is not None:
            runs = shared.simulate(data, warm_up)
            return [runs[..., place] for place in range(len(data.records))]
        return [
            each.ensemble.simulate(self.model.separate(data, place), warm_up)
            for place, each in enumerate(self.prediction_bands)
        ]

    def export(self, kind: str = "python", path: str | Path | None = None) -> str | None:
        """Return the coupled model as text in a format of ``EXPORTS``, or write it to a file."""
        return export_or_write(self.model, kind, path)

    def __repr__(self) -> str:
        names, equations = ", ".join(self.model.output_names), "; ".join(self.equation.splitlines())
        return f"<{type(self).__name__} of {names}: {equations}>"


def read_fitted_model(
    model: CoupledModel,
    document: Mapping[str, Any],
    name: str,
    primitives: Mapping[str, Primitive] = PRIMITIVES,
) -> FittedCoupledModel:
    """Return a model with the warm-up and the prediction bands of its ``result.json``.

    Parameters
    ----------
    model : CoupledModel
    document : mapping
        Content of ``result.json``.
    name : str
        Name of the document, for messages.
    primitives : mapping
        Primitives that expressions may contain.

    Raises
    ------
    ModelError
        The document is damaged.
    """
    try:
        shared = ensemble_from_document(document["ensemble"], model, primitives)
        own = [
            ensemble_from_document(each.get("ensemble"), single, primitives)
            for each, single in zip(document["outputs"], model.models, strict=True)
        ]
        bands = [
            bands_from_document(each.get("bands"), ensemble or shared)
            for each, ensemble in zip(document["outputs"], own, strict=True)
        ]
        warm_up = int(document["warm_up"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"{name} is damaged: {error!r} is missing or wrong") from error
    return FittedCoupledModel(model, warm_up, tuple(each for each in bands if each is not None))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CoupledResult(FittedCoupledModel):
    """One equation per output, chosen for their common free run.

    Attributes
    ----------
    model : CoupledModel
        Equations of all outputs.
    warm_up : int
        Number of samples before the first prediction. The errors depend on it.
    results : tuple of Result
        Result of every output, whose models read the measured values of the other outputs.
    ranks : tuple of int
        Rank of the chosen model in each of these results.
    refined : bool
        Whether the parameters were refined on the common simulation. If not, they are those of the results,
        as with latent models.
    split : CoupledSplit
        Estimation data and validation data with the sampling time of the model.
    left_out : tuple of str
        Steps that a request to stop has left out; empty for a complete result.
    not_computed : mapping
        Optional steps that failed, each with the reason.
    wall_s : float or None
        Duration of all searches in seconds; None if they were not timed.
    refusal : str
        Why the optional facts of the document are not computed; empty if they are.
    """

    results: tuple[Result, ...]
    ranks: tuple[int, ...]
    refined: bool
    split: CoupledSplit
    left_out: tuple[str, ...] = ()
    not_computed: Mapping[str, str] = field(default_factory=dict)
    wall_s: float | None = None
    refusal: str = ""

    def with_wall_time(self, seconds: float) -> "CoupledResult":
        """Return a copy of the result with the duration of all searches in seconds."""
        return replace(self, wall_s=seconds)

    @property
    def metrics(self) -> _Metrics:
        """Errors by output, part and prediction: ``metrics["y1"]["validation"]["free_run"].rmse``.

        The free run is that of all equations together; one step ahead, all outputs are measured. NaN if the
        simulation diverged.
        """
        found: dict[str, dict[str, dict[str, Metrics]]] = {name: {} for name in self.model.output_names}
        for part, record in (("estimation", self.split.estimation), ("validation", self.split.validation)):
            free = self.simulate(record)
            for place, (name, single) in enumerate(
                zip(self.model.output_names, self.model.models, strict=True)
            ):
                y = record.records[place].y
                one = one_step_ahead(single, self.model.separate(record, place), self.warm_up)
                runs = {"one_step_ahead": one.y, "free_run": free.y[:, place]}
                outcomes = {"one_step_ahead": one.outcome, "free_run": free.outcome}
                found[name][part] = {
                    mode: metrics(y, run if outcomes[mode] else y * float("nan"))
                    for mode, run in runs.items()
                }
        return found

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table with one row per output: errors as of `Result.to_pandas`, and the equation.

        Raises
        ------
        SettingsError
            pandas is not installed.
        """
        try:
            import pandas  # noqa: PLC0415
        except ImportError as error:
            raise SettingsError("install pandas to get a table of the outputs") from error
        pairs = zip(self.metrics.items(), self.model.models, strict=True)
        rows = [
            {"output": name, "terms": single.size, **list_errors(errors), "equation": single.equation().named}
            for (name, errors), single in pairs
        ]
        return pandas.DataFrame(rows).set_index("output")

    def _repr_html_(self) -> str:
        sentences = [line for line in self.sentences() if not line.startswith(" ")]
        return render_sentences(sentences, None, "", self.model.equation().mathml)

    def plot(self, output: str) -> "Figure":
        """Draw the free run of one output on the validation data, with its 90 % band."""
        from islands.report.figures.free_run import draw_free_run  # noqa: PLC0415 - matplotlib takes half a second

        place = self.model.output_names.index(output)
        data, run = self.split.validation, self.simulate(self.split.validation)
        band = self.bands(data)[place] if self.prediction_bands else None
        return draw_free_run(data.records[place], run.y[:, place], band=band)

    def save(self, folder: str | Path, steps: Steps | None = None, figures: Sequence[str] = OVERVIEW) -> Path:
        """Write ``result.json``, ``model.json``, ``summary.txt``, ``figures/`` and ``outputs/``.

        ``outputs/`` has a folder with the complete result of every output.

        Parameters
        ----------
        folder, steps, figures
            As for `Result.save`. The figures are those of every output; the common model has its free runs.
        """
        steps = steps or Steps()
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / REPORT_FILE).unlink(missing_ok=True)
        folders = list_folders(self.model.output_names)
        for directory, name, result in zip(folders, self.model.output_names, self.results, strict=True):
            own = Steps(stop=steps.stop)
            result.save(folder / "outputs" / directory, own, figures)
            steps.add(own.left_out, own.not_computed, name)
        self._write(folder)
        if FREE_RUN in figures:
            for directory, name in zip(folders, self.model.output_names, strict=True):
                path = folder / "figures" / f"free-run-{directory}.svg"
                steps.attempt(f"figure {path.stem}", partial(self._draw_figure, name, path))
        if steps.not_computed:
            replace(self, not_computed={**self.not_computed, **steps.not_computed})._write(folder)
        return folder

    def _write(self, folder: Path) -> None:
        (folder / "model.json").write_text(model_json(self.model), encoding="utf-8")
        (folder / "summary.txt").write_text(f"{self}\n", encoding="utf-8")
        replace_file([f"{json.dumps(self.document(), indent=2)}\n".encode()], folder / "result.json")

    def _draw_figure(self, output: str, path: Path) -> None:
        from islands.report.figures.style import save  # noqa: PLC0415 - matplotlib takes half a second

        path.parent.mkdir(exist_ok=True)
        save(self.plot(output), path)

    def document(self) -> dict[str, Any]:
        """Return the content of ``result.json`` as JSON values."""
        metrics, names, steps = self.metrics, self.model.output_names, Steps()
        steps.refusal = self.refusal
        residuals = [
            steps.attempt(f"residual tests of {name}", partial(self._measure_residual, place))
            for place, name in enumerate(names)
        ]
        left_out = [
            steps.attempt(f"gross errors of {name}", partial(self._measure_left_out, place))
            for place, name in enumerate(names)
        ]
        not_computed = {**self.not_computed, **steps.not_computed}
        document = {
            "schema": COUPLED_RESULT_SCHEMA,
            "dt": self.model.dt,
            "average": self.model.average,
            "warm_up": self.warm_up,
            "refined": self.refined,
            "wall_s": self.wall_s,
            "seed": self.results[0].search_result.seed,
            "settings": dict(self.results[0].settings),
            "left_out": list(self.left_out),
            "not_computed": list_failures(not_computed),
            "equation": self.equation,
            "signals": coupled_signals(self.model),
            "outputs": [
                {
                    "name": name,
                    "unit": self.split.validation.records[place].output_unit,
                    "folder": f"outputs/{list_folders(self.model.output_names)[place]}",
                    "rank": self.ranks[place],
                    **self._bands_document(place),
                    "data": {
                        "noise": measure_output_noise(self.split.estimation.records[place]),
                        "output_range": self.split.validation.records[place].output_range,
                        "left_out": left_out[place],
                    },
                    "residual": residual_structure_document(residuals[place] or missing_structure()),
                    "metrics": {
                        part: {mode: asdict(each) for mode, each in by_mode.items()}
                        for part, by_mode in metrics[name].items()
                    },
                }
                for place, name in enumerate(names)
            ],
            "inputs": {
                "estimation": measure_input_ranges(self.split.estimation.records[0]),
                "validation": measure_input_ranges(self.split.validation.records[0]),
            },
            "models": [self._model_document(metrics)],
            "ensemble": ensemble_document(self._shared_ensemble),
            "estimation": record_document(self.split.estimation.records[0]) | {"names": self._names()},
            "validation": record_document(self.split.validation.records[0]) | {"names": self._names()},
        }
        described: dict[str, Any] = finite(document)
        return described

    def _bands_document(self, place: int) -> dict[str, Any]:
        """Return the bands of an output as JSON values, with its ensemble if it has its own."""
        bands = self.prediction_bands[place] if self.prediction_bands else None
        described: dict[str, Any] = {"bands": bands_document(bands)}
        if bands is not None and self._shared_ensemble is None:
            described["ensemble"] = ensemble_document(bands.ensemble)
        return described

    def _measure_left_out(self, place: int) -> dict[str, Any] | None:
        """Return the errors of an output over the whole record, without and with its gross errors."""
        record = self.split.record
        return measure_left_out(record.records[place], lambda: self.simulate(record).y[:, place])

    def _measure_residual(self, place: int) -> ResidualStructure:
        """Measure the residuals of an output on the longest recording of the validation data."""
        data = self.split.validation
        first, last = max(data.bounds, key=lambda bounds: bounds[1] - bounds[0])
        recording = data.map(lambda each: each[first:last])
        record, warm_up = recording.records[place], self.warm_up
        one = one_step_ahead(self.model.models[place], self.model.separate(recording, place), warm_up)
        free = self.simulate(recording)
        one_step, simulated = (
            (record.y - y)[warm_up:] if outcome else None
            for y, outcome in ((one.y, one.outcome), (free.y[:, place], free.outcome))
        )
        return measure_structure(
            one_step, simulated, record.u[warm_up:], record.y[warm_up:], data.records[place].output_range
        )

    def _model_document(self, metrics: _Metrics) -> dict[str, Any]:
        written = self.model.equation()
        return {
            "kind": self.model.kind,
            "rank": 1,
            "recommended": True,
            "size": self.model.size,
            "equation": self.equation,
            "latex": written.latex,
            "signals": coupled_signals(self.model),
            "terms": terms_in_result(self.model, self._shared_ensemble),
            "metrics": {
                part: {
                    mode: _average([parts[part][mode] for parts in metrics.values()])
                    for mode in ("one_step_ahead", "free_run")
                }
                for part in ("estimation", "validation")
            },
            "warm_up": self.warm_up,
        }

    def sentences(self) -> list[str]:
        """Return the result in sentences; the equations are indented."""
        return describe_coupled(self.document())

    def _names(self) -> dict[str, list[str]]:
        return {"inputs": list(self.model.input_names), "outputs": list(self.model.output_names)}

    def _describe_parameters(self) -> str:
        """Return the size of the model, and the estimate of its parameters."""
        if isinstance(self.model, CoupledLatentModel):
            return f"{self.model.size} parameters, those of separate searches"
        refined = "refined together on the free run" if self.refined else "those of the separate equations"
        return f"{self.model.size} terms, parameters {refined}"

    def __str__(self) -> str:
        sentences, errors = self.sentences(), len(self.model.models)
        # The errors are in the table.
        head, rest = [sentences[0], *sentences[errors + 1 : errors + 3]], sentences[errors + 5 :]
        lines = [
            *(line for sentence in head for line in wrap(sentence)),
            "",
            f"{len(self.model.models)} outputs, {self._describe_parameters()}:",
            "",
            *(line for single in self.model.models for line in [*term_table(single), ""]),
            *wrap(f"{coupled_signals(self.model) or f'k counts samples of {self.split.validation.dt:g} s'}."),
            "",
            "Validation data; all outputs are simulated together, from the inputs alone:",
            f"{'output':20} {'free-run RMSE':>18} {'% of range':>10} {'R2':>8} {'one-step RMSE':>18}",
        ]
        for record, (name, parts) in zip(self.split.validation.records, self.metrics.items(), strict=True):
            free, one = parts["validation"]["free_run"], parts["validation"]["one_step_ahead"]
            unit = f" {record.output_unit}".rstrip()
            lines.append(
                f"{name:20} {f'{free.rmse:.4g}{unit}':>18} {free.mape:10.3g} {free.r2:8.4f} "
                f"{f'{one.rmse:.4g}{unit}':>18}"
            )
        return "\n".join([*lines, "", *(line for sentence in rest for line in wrap(sentence))])


def _average(metrics: Sequence[Metrics]) -> dict[str, float]:
    """Return the means over the outputs of the errors that have no unit."""
    return {
        name: float(np.mean([getattr(each, name) for each in metrics]))
        for name in ("mape", "r2", "fit_percent")
    }


def list_folders(outputs: Sequence[str]) -> list[str]:
    """Return the name of the folder of every output, such as ``1-level_cm``."""
    return [f"{place}-{re.sub(r'[^A-Za-z0-9_.-]', '_', name)}" for place, name in enumerate(outputs, start=1)]
