"""Sentences about a result of several outputs, from its ``result.json`` alone; see `statements`."""

from functools import cached_property

from islands.models.coupled_latent import CoupledLatentModel
from islands.records.split import compare_input_ranges
from islands.report.text.facts import Document, RunFacts, list_insignificant
from islands.report.text.statements import describe_not_computed
from islands.report.text.templates import write


class OutputFacts(RunFacts):
    """Quantities of the common free run of one output.

    Parameters
    ----------
    output : mapping
        Entry of the output in ``result.json``.
    """

    def __init__(self, output: Document) -> None:
        self.name: str = output["name"]
        bands, residual = output["bands"] or {}, output["residual"]
        super().__init__(output["metrics"], output["unit"], bands, residual, output["data"])


class CoupledFacts:
    """Quantities of a result of several outputs that the statements read.

    Parameters
    ----------
    document : mapping
        Content of ``result.json``.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self.model: Document = document["models"][0]
        #: Whether every output has a latent model from a separate search.
        self.is_latent = self.model.get("kind") == CoupledLatentModel.kind
        self.outputs = tuple(map(OutputFacts, document["outputs"]))
        record, ranges = document["estimation"], document["inputs"]
        self.extrapolation = compare_input_ranges(
            record["names"]["inputs"], record["units"]["inputs"], ranges["estimation"], ranges["validation"]
        )

    @property
    def simulates(self) -> bool:
        """Whether the common free run follows every output."""
        return all(output.simulates for output in self.outputs)

    @property
    def predicts(self) -> bool:
        """Whether the prediction one step ahead follows every output."""
        return all(output.predicts for output in self.outputs)

    @property
    def generalises_poorly(self) -> bool:
        """Whether the error of an output is much larger on the validation data."""
        return any(output.generalises_poorly for output in self.outputs)

    @property
    def structured(self) -> list[OutputFacts]:
        """Outputs of which a part of the residual is predictable."""
        return [output for output in self.outputs if output.has_structure]

    @property
    def adequate(self) -> list[OutputFacts]:
        """Outputs in whose residual no structure is left."""
        return [output for output in self.outputs if output.is_unpredictable and not output.exceeds_noise]

    @cached_property
    def insignificant(self) -> list[str]:
        """Terms whose parameters are within two standard errors of zero."""
        return list_insignificant(self.model["terms"])


def describe_coupled(document: Document) -> list[str]:
    """Describe a result of several outputs in sentences; the equations are indented."""
    facts = CoupledFacts(document)
    # A divergence of the common free run concerns every output.
    failed = [text for each in facts.outputs for text in write("coupled.txt", "limit", output=each)]
    limits = list(dict.fromkeys([*failed, *write("coupled.txt", "extrapolation", f=facts)]))
    uses = write("coupled.txt", "use", f=facts, limits=limits)
    listed = ((each.name, write("coupled.txt", "detail", output=each)) for each in facts.outputs)
    details = [f"{name}: {', '.join(parts)}" for name, parts in listed if parts]
    return [
        *write("coupled.txt", "verdict", f=facts, limits=limits, details=details),
        *(text for each in facts.outputs for text in write("coupled.txt", "error", output=each)),
        f"Fails at: {'; '.join(limits) or 'none of the checks'}.",
        f"Next: {'; '.join(write('coupled.txt', 'next', f=facts))}.",
        *write("coupled.txt", "equations", f=facts),
        f"    {'; '.join(document['equation'].splitlines())}",
        f"Good for: {'; '.join(uses) or 'no use that the checks confirm'}.",
        *(text for each in facts.outputs for text in write("coupled.txt", "left_out", output=each)),
        *describe_not_computed(document),
    ]
