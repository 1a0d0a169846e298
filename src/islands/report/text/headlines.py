"""Headlines of reports, from the documents of results alone: one sentence with the error in per cent."""

from collections.abc import Sequence

from islands.report.text.diagnosis_facts import DiagnosisFacts
from islands.report.text.facts import (
    Document,
    ResultFacts,
    is_refitted,
)
from islands.report.text.templates import write


def write_headline(document: Document) -> str:
    """State the size of the recommended model, and its free-run error on the validation data.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """
    return "".join(write("headlines.txt", "result", f=ResultFacts(document)))


def write_coupled_headline(outputs: Sequence[Document]) -> str:
    """State the free-run error of every output of a model of several on the validation data.

    Parameters
    ----------
    outputs : sequence of mapping
        Entries of ``outputs`` in ``result.json``.
    """
    diverges = any(each["metrics"]["validation"]["free_run"]["rmse"] is None for each in outputs)
    return "".join(write("headlines.txt", "coupled", outputs=outputs, diverges=diverges))


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
    # The error that is stated is the least one; it is undefined for a constant output.
    stated = "rmse" if any(errors[at]["mape"] is None for at in known) else "mape"
    best = min(known, key=lambda at: float(errors[at][stated]), default=0)
    name, (_, unit), entry = models[best]
    values = {"name": name, "unit": unit, "error": errors[best], "is_refitted": is_refitted(entry)}
    values |= {"count": len(models), "outputs": outputs, "is_comparable": is_comparable}
    return "".join(write("headlines.txt", "comparison", diverges=not known, **values))


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
