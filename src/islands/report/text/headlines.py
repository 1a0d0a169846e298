"""Headlines of reports, from the documents of results alone: one sentence with the error in per cent."""

from collections.abc import Sequence

from islands.report.text.diagnosis_facts import DiagnosisFacts
from islands.report.text.facts import (
    BEFORE_REFIT,
    Document,
    ResultFacts,
    is_refitted,
    write_amount,
)
from islands.report.text.templates import write


def write_headline(document: Document) -> str:
    """State the size of the recommended model, and its free-run error on the validation data.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """
    facts = ResultFacts(document)
    size, output = facts.model["size"], facts.record["names"]["output"]
    counted = "parameter" if facts.has_named_parameters else "term"
    terms = f"{size} {counted}{'s' * (size != 1)}"
    error = facts.error()
    if error["rmse"] is None:
        return f"The free run of a model of {terms} diverges on the validation data of {output}"
    stated = _state_error(error, facts.unit) + _add_refit(facts.model)
    return f"A model of {terms} simulates {output} with a {stated}"


def write_coupled_headline(outputs: Sequence[Document]) -> str:
    """State the free-run error of every output of a model of several on the validation data.

    Parameters
    ----------
    outputs : sequence of mapping
        Entries of ``outputs`` in ``result.json``.
    """
    errors = [each["metrics"]["validation"]["free_run"] for each in outputs]
    names = " and ".join(each["name"] for each in outputs)
    if any(each["rmse"] is None for each in errors):
        return f"The free run of the model of {names} diverges on the validation data"
    stated = [
        f"{each['name']} with a {_state_error(error, each['unit'])}"
        for each, error in zip(outputs, errors, strict=True)
    ]
    return f"The model of {len(outputs)} outputs simulates {' and '.join(stated)}"


def write_comparison_headline(
    models: Sequence[tuple[str, tuple[str, str], Document]], is_comparable: bool
) -> str:
    """State which of several models has the least free-run error on the validation data.

    Parameters
    ----------
    models : sequence of (str, (str, str), mapping)
        Name of each model, name and unit of its output, and its entry in ``result.json``.
    is_comparable : bool
        Whether all models were validated on the same samples.
    """
    outputs = " and ".join(dict.fromkeys(output for _, (output, _), _ in models))
    errors = [entry["metrics"]["validation"]["free_run"] for _, _, entry in models]
    known = [at for at, error in enumerate(errors) if error["rmse"] is not None]
    if not is_comparable:
        return f"{len(models)} models of {outputs}"
    if not known:
        return f"The free runs of {len(models)} models of {outputs} diverge on the validation data"
    # The error that is stated is the least one; it is undefined for a constant output.
    stated = "rmse" if any(errors[at]["mape"] is None for at in known) else "mape"
    name, (_, unit), _ = models[best := min(known, key=lambda at: float(errors[at][stated]))]
    error = _state_error(errors[best], unit) + _add_refit(models[best][2])
    return f"Of {len(models)} models, {name} simulates {outputs} best, with a {error}"


def write_diagnosis_headline(document: Document) -> str:
    """State the error of the simulation on the held-out data, and that of the extended simulation.

    Parameters
    ----------
    document : mapping
        Content of ``discrepancy.json``.

    Returns
    -------
    str
        Empty if the errors are unknown.
    """
    return "".join(write("diagnosis.txt", "headline", f=DiagnosisFacts(document)))


def _state_error(error: Document, unit: str) -> str:
    # The error relative to the range is undefined for a constant output.
    if error["mape"] is None:
        return f"free-run error (RMSE) of {write_amount(error['rmse'], unit)}"
    return f"mean absolute error of {error['mape']:.3g} % of its range"


def _add_refit(entry: Document) -> str:
    return f", {BEFORE_REFIT}" if is_refitted(entry) else ""
