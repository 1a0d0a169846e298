"""HTML report of a comparison of models of any jobs: errors, free runs, equations, parameters, settings."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import ascii_uppercase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.errors import SettingsError
from islands.report.pages.origin import Origin
from islands.report.pages.rendering import TEMPLATES, inline_figure
from islands.report.text.facts import BEFORE_REFIT, Document, is_refitted
from islands.rounding import NORMAL_95
from islands.sentences import write, write_one

#: Fewest and most models of a comparison: the colours of more lines are not distinct.
LEAST_MODELS, MOST_MODELS = 2, 6

#: Columns of the table of the models.
_COLUMNS = ("model", "size", "MAPE est. %", "MAPE val. %", "RMSE val.", "R² val.", "one-step RMSE val.")


@dataclass(frozen=True, slots=True)
class ComparedModel:
    """A model of a comparison.

    Attributes
    ----------
    name : str
        Name of its job, with its rank.
    document : mapping
        Content of ``result.json``.
    model : mapping
        Entry of the model in it.
    free_run : mapping or None
        Fields of `islands_api.result_schemas.FreeRun`; None for a model of several outputs.
    request : mapping
        Request of the job, whose fields are compared.
    """

    name: str
    document: Document
    model: Document
    free_run: Document | None
    request: Mapping[str, Any]

    @property
    def record(self) -> Document:
        """Description of the estimation data; a result of several outputs has no other one."""
        found: Document = self.document.get("record") or self.document["estimation"]
        return found

    @property
    def output(self) -> tuple[str, str]:
        """Name of the output and its unit; several names without units."""
        names, units = self.record["names"], self.record["units"]
        if "outputs" in names:
            return ", ".join(names["outputs"]), ""
        return names["output"], units["output"]

    @property
    def validation(self) -> str:
        """Text that is equal for models that were validated on the same samples."""
        if self.free_run is None:
            return json.dumps([self.record["names"], self.document["validation"]["sha256"]])
        return json.dumps([self.output, self.free_run["time_s"], self.free_run["measured"]])


def comparison_report(origin: Origin, models: Sequence[ComparedModel]) -> bytes:
    """Write the report of a comparison. Letters name the models in its tables and figures.

    Parameters
    ----------
    origin : Origin
    models : sequence of ComparedModel

    Raises
    ------
    SettingsError
        There are fewer than two models, or more than six.
    """
    if not LEAST_MODELS <= len(models) <= MOST_MODELS:
        raise SettingsError(
            f"a comparison has {LEAST_MODELS} to {MOST_MODELS} models, {len(models)} were given"
        )
    lettered = dict(zip(ascii_uppercase, models, strict=False))
    groups = _group(lettered)
    letters = tuple(lettered)
    facts = _compare(lettered, len(groups) == 1)
    text = TEMPLATES.get_template("comparison.html").render(
        origin=origin,
        hashes=list(dict.fromkeys(each.record["sha256"] for each in models)),
        headline=write_one("comparison", "headline", **facts),
        lead=" ".join(write("comparison", "lead", **facts)),
        columns=_COLUMNS,
        errors=[_list_errors(letter, each) for letter, each in lettered.items()],
        figures=_draw_groups(groups),
        undrawn=[letter for letter, each in lettered.items() if each.free_run is None],
        equations=[(letter, each.name, each.model["equation"]) for letter, each in lettered.items()],
        letters=letters,
        terms=_list_terms(models),
        settings=_list_settings(models),
    )
    return text.encode()


def _group(lettered: Mapping[str, ComparedModel]) -> list[dict[str, ComparedModel]]:
    """Return the models by the samples that they were validated on."""
    groups: dict[str, dict[str, ComparedModel]] = {}
    for letter, each in lettered.items():
        groups.setdefault(each.validation, {})[letter] = each
    return list(groups.values())


def _compare(lettered: Mapping[str, ComparedModel], is_comparable: bool) -> dict[str, Any]:
    """Return the facts of a comparison: the model with the least free-run error on the validation data."""
    models = tuple(lettered.values())
    errors = [each.model["metrics"]["validation"]["free_run"] for each in models]
    known = [at for at, error in enumerate(errors) if error["rmse"] is not None]
    # The error that is stated is the least one; it is undefined for a constant output.
    stated = "rmse" if any(errors[at]["mape"] is None for at in known) else "mape"
    best = min(known, key=lambda at: float(errors[at][stated]), default=0)
    return {
        "count": len(models),
        "outputs": dict.fromkeys(each.output[0] for each in models),
        "name": models[best].name,
        "error": errors[best],
        "unit": models[best].output[1],
        "note": BEFORE_REFIT if is_refitted(models[best].model) else "",
        "diverges": not known,
        "is_comparable": is_comparable,
        "has_same_data": len({each.record["sha256"] for each in models}) == 1,
        "refitted": [letter for letter, each in lettered.items() if is_refitted(each.model)],
        "refit_note": BEFORE_REFIT,
    }


def _list_errors(letter: str, compared: ComparedModel) -> list[str]:
    estimation, validation = (compared.model["metrics"][part] for part in ("estimation", "validation"))
    numbers = (
        (estimation["free_run"]["mape"], "{:.3g}"),
        (validation["free_run"]["mape"], "{:.3g}"),
        (validation["free_run"]["rmse"], "{:.4g}"),
        (validation["free_run"]["r2"], "{:.5f}"),
        (validation["one_step_ahead"]["rmse"], "{:.4g}"),
    )
    cells = ("-" if value is None else form.format(value) for value, form in numbers)
    return [f"{letter}: {compared.name}", str(compared.model["size"]), *cells]


def _draw_groups(groups: Sequence[Mapping[str, ComparedModel]]) -> list[tuple[str, str]]:
    """Return the caption and the address of the figure of every group of models of one output."""
    # matplotlib takes half a second to import.
    from islands.report.figures.comparison import RUN_STYLES, draw_comparison  # noqa: PLC0415

    styles = dict(zip(ascii_uppercase, RUN_STYLES, strict=False))
    drawn = []
    for group in groups:
        runs = {letter: each.free_run for letter, each in group.items() if each.free_run is not None}
        if not runs:
            continue
        first, output = next(iter(runs.values())), next(iter(group.values())).output
        figure = draw_comparison(
            _array(first["time_s"]),
            _array(first["measured"]),
            {letter: _array(run["free_run"]) for letter, run in runs.items()},
            output,
            styles,
            residuals=len(groups) == 1,
        )
        title = "Free runs over the validation data" if len(groups) == 1 else f"Free run of {', '.join(runs)}"
        drawn.append((title, inline_figure(figure)))
    return drawn


def _array(values: Sequence[float | None]) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)


def _list_terms(models: Sequence[ComparedModel]) -> list[list[str]]:
    """Return every term with its parameter in each model."""
    found = [{each.get("term", each["regressor"]): each for each in one.model["terms"]} for one in models]
    names = dict.fromkeys(name for terms in found for name in terms)
    return [[name, *(_state_parameter(terms.get(name)) for terms in found)] for name in names]


def _state_parameter(term: Document | None) -> str:
    if term is None:
        return ""
    error = term["standard_error"]
    return f"{term['parameter']:.5g}" + (f" ± {NORMAL_95 * error:.2g}" if error else "")


def _list_settings(models: Sequence[ComparedModel]) -> list[list[str]]:
    """Return the fields of the requests that are not equal in all jobs."""
    requests = [{**each.request, **(each.request.get("settings") or {})} for each in models]
    names = dict.fromkeys(name for request in requests for name in request if name != "settings")
    rows = [[name, *(_write_setting(request.get(name)) for request in requests)] for name in names]
    return [row for row in rows if len(set(row[1:])) > 1]


def _write_setting(value: Any) -> str:
    if value is None:
        return "default"
    return value if isinstance(value, str) else json.dumps(value)
