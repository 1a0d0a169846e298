"""Sentences about the recommended model of a result, from ``result.json`` alone.

A run, its folder, the REST service, the report and a notebook state the same.
"""

from islands.report.text.facts import Document, ResultFacts
from islands.report.text.templates import write


def describe(document: Document) -> list[str]:
    """Describe the recommended model in sentences: equation, error, uses, failures and next steps.

    The equation and the units are indented.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """
    model = ResultFacts(document).model
    return [
        describe_choice(document),
        f"    {model.get('named_equation', model['equation'])}",
        f"    {describe_units(document)}",
        *describe_findings(document),
    ]


def describe_choice(document: Document) -> str:
    """State which model is recommended, and the first reason, or that none is of use."""
    return "".join(write("result.txt", "choice", f=ResultFacts(document)))


def describe_units(document: Document) -> str:
    """State the units of the columns, the signals that the equation reads and direct feedthrough."""
    return "".join(write("result.txt", "units", f=ResultFacts(document)))


def describe_verdict(document: Document) -> str:
    """State whether the model is of use as a simulation, with the measured quantities."""
    facts = ResultFacts(document)
    limits, details = (write("result.txt", group, f=facts) for group in ("limit", "detail"))
    return "".join(write("result.txt", "verdict", f=facts, limits=limits, details=details))


def describe_findings(document: Document) -> list[str]:
    """Describe errors, uncertainty, uses, failures and next steps of the recommended model."""
    facts = ResultFacts(document)
    limits = write("result.txt", "limit", f=facts)
    return [
        *write("result.txt", "measure", f=facts),
        describe_verdict(document),
        *list_findings(
            write("result.txt", "use", f=facts, limits=limits), limits, write("result.txt", "next", f=facts)
        ),
        *describe_not_computed(document),
    ]


def list_findings(uses: list[str], limits: list[str], steps: list[str]) -> list[str]:
    """State uses, failed checks and next steps, each in one sentence."""
    return [
        f"Good for: {'; '.join(uses) or 'no use that the checks confirm'}.",
        f"Fails at: {'; '.join(limits) or 'none of the checks'}.",
        f"Next: {'; '.join(steps)}.",
    ]


def describe_not_computed(document: Document) -> list[str]:
    """State each optional step that failed, with the reason; a result of an earlier version has none."""
    return [f"Not computed: {each['step']}: {each['reason']}." for each in document.get("not_computed", ())]
