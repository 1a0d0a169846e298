"""Statements about results and diagnoses: those of ``result.json`` and ``discrepancy.json`` alone.

A run, its folder, the REST service, the page, the report and a notebook state the same.
"""

from islands.report.text.diagnosis_facts import DiagnosisFacts
from islands.report.text.facts import Document, make_facts
from islands.sentences import write, write_named, write_one


def describe(document: Document) -> list[str]:
    """Describe the recommended model in sentences: its essence, the equation, and further findings.

    The equation and the units are indented. A linear system whose parameters are coordinates of its states
    has no equation that a reader could use.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """
    facts = make_facts(document)
    equation = "" if facts.quantities else "; ".join(facts.model["equation"].splitlines())
    return [
        *facts.state("essence"),
        write_one("result", "choice", f=facts),
        *([f"    {equation}"] if equation else []),
        f"    {write_one('result', 'units', f=facts)}",
        *facts.state("finding"),
    ]


def describe_diagnosis(document: Document) -> list[str]:
    """Describe a diagnosis in sentences: verdict, causes, findings, errors and next steps.

    The causes are indented.

    Parameters
    ----------
    document : mapping
        Content of ``discrepancy.json``.
    """
    facts = DiagnosisFacts(document)
    causes = (f"  {cause}" for cause in describe_causes(facts))
    return [describe_verdict(facts), *causes, *describe_details(facts)]


def describe_headline(document: Document) -> list[str]:
    """Describe a diagnosis in its most important sentences: verdict, causes, and errors or correction.

    They are sentences of `describe_diagnosis`, without indents.
    """
    facts = DiagnosisFacts(document)
    names = ("detail_record",) if facts.is_gross else ("detail_gain", "detail_error")
    lines = (line for name in names for line in write("diagnosis", name, f=facts))
    return [describe_verdict(facts), *describe_causes(facts), *lines]


def describe_verdict(facts: DiagnosisFacts) -> str:
    """State the verdict."""
    return write_one("diagnosis", "verdict", f=facts)


def describe_causes(facts: DiagnosisFacts) -> list[str]:
    """Describe each cause: values, confidence, share of the misfit, and equivalent causes."""
    return [write_one("diagnosis", "cause", f=facts, cause=cause) for cause in facts.causes]


def describe_details(facts: DiagnosisFacts, has_extension: bool = True) -> list[str]:
    """Describe noise, record, errors, and next steps, and the extended simulation unless it is left out."""
    named = write_named("diagnosis", "detail", f=facts)
    chosen = (text for name, text in named if has_extension or name != "detail_extended_simulation")
    return [line for text in chosen for line in text.splitlines()]
