"""Sentences about the recommended model of a result, from ``result.json`` alone.

A run, its folder, the REST service, the report and a notebook state the same.
"""

from islands.report.text.facts import Document, ResultFacts
from islands.report.text.templates import write


def describe(document: Document) -> list[str]:
    """Describe the recommended model in sentences: its essence, the equation, and further findings.

    The equation and the units are indented.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """
    model = ResultFacts(document).model
    return [
        *describe_essence(document),
        describe_choice(document),
        f"    {model['named_equation']}",
        f"    {describe_units(document)}",
        *describe_findings(document),
    ]


def describe_essence(document: Document) -> list[str]:
    """State verdict, error against noise and a linear model, physics, failed checks and next steps."""
    facts = ResultFacts(document)
    limits, names = write("result.txt", "limit", f=facts), ("verdict", "error", "physics")
    return [
        *(text for name in names for text in write("result.txt", name, f=facts, limits=limits)),
        f"Fails at: {'; '.join(limits) or 'none of the checks'}.",
        f"Next: {'; '.join(write('result.txt', 'next', f=facts))}.",
    ]


def describe_choice(document: Document) -> str:
    """State which model is recommended, and the first reason, or that none is of use."""
    return "".join(write("result.txt", "choice", f=ResultFacts(document)))


def describe_units(document: Document) -> str:
    """State the units of the columns, the signals that the equation reads and direct feedthrough."""
    return "".join(write("result.txt", "units", f=ResultFacts(document)))


def describe_findings(document: Document) -> list[str]:
    """Describe the estimate, further errors, uncertainty and uses of the recommended model."""
    facts = ResultFacts(document)
    uses = write("result.txt", "use", f=facts, limits=write("result.txt", "limit", f=facts))
    details = write("result.txt", "detail", f=facts)
    return [
        *write("result.txt", "measure", f=facts),
        *([f"Measured: {'; '.join(details)}."] if details else []),
        f"Good for: {'; '.join(uses) or 'no use that the checks confirm'}.",
        *describe_not_computed(document),
    ]


def describe_not_computed(document: Document) -> list[str]:
    """State each optional step that failed, with the reason."""
    return [f"Not computed: {each['step']}: {each['reason']}." for each in document["not_computed"]]
