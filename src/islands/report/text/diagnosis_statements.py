"""Sentences about a diagnosis, from ``discrepancy.json`` alone.

A run, its folder, the REST service, the page, the report and a notebook state the same.
"""

from functools import partial

from islands.report.text.diagnosis_facts import DiagnosisFacts
from islands.report.text.facts import Document
from islands.report.text.templates import write, write_named

_write = partial(write, "diagnosis.txt")


def describe_diagnosis(document: Document) -> list[str]:
    """Describe a diagnosis in sentences: verdict, causes, findings, errors and next steps.

    The causes are indented.

    Parameters
    ----------
    document : mapping
        Content of ``discrepancy.json``.
    """
    causes = (f"  {cause}" for cause in describe_causes(document))
    return [describe_verdict(document), *causes, *describe_details(document)]


def describe_headline(document: Document) -> list[str]:
    """Describe a diagnosis in its most important sentences: verdict, causes, and errors or correction.

    They are sentences of `describe_diagnosis`, without indents.
    """
    facts = DiagnosisFacts(document)
    names = ("detail_record",) if facts.is_gross else ("detail_gain", "detail_error")
    lines = (line for name in names for text in _write(name, f=facts) for line in text.splitlines())
    return [describe_verdict(document), *describe_causes(document), *lines]


def describe_verdict(document: Document) -> str:
    """State the verdict."""
    return " ".join(_write("verdict", f=DiagnosisFacts(document)))


def describe_causes(document: Document) -> list[str]:
    """Describe each cause: values, confidence, share of the misfit, and equivalent causes."""
    facts = DiagnosisFacts(document)
    return [text for cause in facts.causes for text in _write("cause", f=facts, cause=cause)]


def describe_details(document: Document, has_extension: bool = True) -> list[str]:
    """Describe noise, record, errors, and next steps, and the extended simulation unless it is left out."""
    named = write_named("diagnosis.txt", "detail", f=DiagnosisFacts(document))
    chosen = (text for name, text in named if has_extension or name != "detail_extended_simulation")
    return [line for text in chosen for line in text.splitlines()]


def describe_extended_values(document: Document) -> tuple[str, str]:
    """State the values in the equations of the extended simulation, and what these contain.

    Returns
    -------
    str, str
        Sentences; empty if there is nothing to state.
    """
    facts = DiagnosisFacts(document)
    values, notes = ("".join(_write(name, f=facts)) for name in ("extended_values", "extended_notes"))
    return values, notes


def name_reference(document: Document) -> str:
    """Name the simulation with which the extended one is compared."""
    return "".join(_write("reference", f=DiagnosisFacts(document)))
