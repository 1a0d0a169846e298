"""Statements about a result of several outputs, from its ``result.json`` alone; see `statements`."""

from typing import Final

from islands.errors import name_option
from islands.models.coupled_latent import CoupledLatentModel
from islands.records.split import compare_input_ranges
from islands.report.text.statements import (
    EXTRAPOLATION,
    NO_SIMULATION,
    SIMULATION_USES,
    TEST,
    UNCERTAIN_RATIO,
    VERDICTS,
    Document,
    RunFacts,
    Statement,
    describe_error_level,
    describe_estimation_error,
    describe_excess,
    describe_few_errors,
    describe_insignificant,
    describe_not_computed,
    describe_unexplained_error,
    describe_wide_band,
    list_insignificant,
    typical_half_width,
    write_percent,
    write_statements,
)
from islands.validation.prediction_bands import LEVEL


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
    def structured(self) -> list[OutputFacts]:
        """Outputs of which a part of the residual is predictable."""
        return [output for output in self.outputs if output.has_structure]

    @property
    def has_limits(self) -> bool:
        """Whether a check fails."""
        return bool(write_statements(FAILURES, self) or self.list_failures())

    @property
    def measured(self) -> str:
        """Measured quantities of the verdict, by output."""
        listed = ((output.name, write_statements(OUTPUT_DETAILS, output)) for output in self.outputs)
        return "; ".join(f"{name}: {', '.join(parts)}" for name, parts in listed if parts)

    def list_failures(self) -> list[str]:
        """Return the checks that an output fails."""
        return [text for output in self.outputs for text in write_statements(OUTPUT_FAILURES, output)]


def describe_coupled(document: Document) -> list[str]:
    """Describe a result of several outputs in sentences; the second one is the equations."""
    facts = CoupledFacts(document)
    # A divergence of the common free run concerns every output.
    bad = list(dict.fromkeys([*facts.list_failures(), *write_statements(FAILURES, facts)]))
    good = write_statements(USES, facts)
    return [
        _describe_equations(facts),
        "; ".join(document["equation"].splitlines()),
        *(f"{output.name}: {_describe_output(output)}." for output in facts.outputs),
        *write_statements(VERDICTS, facts),
        f"Good for: {'; '.join(good) or 'no use that the checks confirm'}.",
        f"Fails at: {'; '.join(bad) or 'none of the checks'}.",
        f"Next: {'; '.join(write_statements(NEXT_STEPS, facts))}.",
        *describe_not_computed(document),
    ]


def _describe_equations(facts: CoupledFacts) -> str:
    document = facts.document
    if facts.is_latent:
        return (
            f"One latent model of the inputs for each of {len(facts.outputs)} outputs, {facts.model['size']} "
            "parameters; each model is from a separate search."
        )
    refined = "were refined together" if document["refined"] else "are those of separate searches"
    return (
        f"One equation for each of {len(facts.outputs)} outputs, {facts.model['size']} terms; the parameters "
        f"{refined}."
    )


def _describe_output(output: OutputFacts) -> str:
    free, one = output.error(), output.error("one_step_ahead")
    if free["rmse"] is None:
        return "the common free run on the validation data diverges"
    # Both are undefined for a constant output.
    error = "" if free["mape"] is None else f" has an error of {free['mape']:.3g} % of the range"
    r2 = "" if free["r2"] is None else f", R2 {free['r2']:.4f}"
    ahead = "it diverges" if one["rmse"] is None else f"RMSE {output.write_amount(one['rmse'])}"
    text = (
        f"the common free run on the validation data{error} (RMSE {output.write_amount(free['rmse'])}{r2}), "
        f"one step ahead {ahead}"
    )
    if output.bands:
        half = output.write_amount(typical_half_width(output.bands))
        text += f"; a new measurement is within {half} of it in {100 * LEVEL:g} % of the samples"
    return text


def _suggest_models(facts: CoupledFacts) -> str:
    if facts.is_latent:
        return f"another structure, or NARX equations ({name_option('model', 'narx')}), for the models"
    return "other terms or more lags in the equations"


def _list_names(outputs: list[OutputFacts]) -> str:
    return " and ".join(output.name for output in outputs)


def _find_unstructured(facts: CoupledFacts) -> list[OutputFacts]:
    return [output for output in facts.outputs if output.is_unpredictable and not output.exceeds_noise]


#: Measured quantities of an output in the verdict.
OUTPUT_DETAILS: Final[tuple[Statement[OutputFacts], ...]] = (
    Statement(
        "predictable-share",
        lambda output: output.share("free_run") is not None,
        lambda output: f"{write_percent(output.share('free_run') or 0.0)} of its residual is predictable",
    ),
    Statement(
        "error-level",
        lambda output: describe_error_level(output, output.name),
        lambda output: describe_error_level(output, output.name),
    ),
    Statement(
        "coverage",
        lambda output: output.coverage is not None,
        lambda output: (
            f"{write_percent(output.coverage or 0.0)} of the validation samples are in the {100 * LEVEL:g} % "
            "band"
        ),
    ),
    Statement("few-errors", lambda output: output.likely_ratio >= UNCERTAIN_RATIO, describe_few_errors),
)

#: Checks that an output fails.
OUTPUT_FAILURES: Final[tuple[Statement[OutputFacts], ...]] = (
    NO_SIMULATION,
    Statement(
        "poor-simulation",
        lambda output: output.error()["rmse"] is not None and not output.simulates,
        lambda output: f"simulation from the inputs alone: R2 {output.error()['r2']:.3f} of {output.name}",
    ),
    Statement(
        "predictable-residual",
        lambda output: output.has_visible_structure,
        lambda output: (
            f"{write_percent(output.share('free_run') or 0.0)} of the residual of {output.name} is "
            f"predictable (RMS {output.residual['predictable_percent']:.2g} % of the output range)"
        ),
    ),
    Statement(
        "unexplained-error",
        lambda output: output.exceeds_noise,
        lambda output: f"{output.name}: {describe_unexplained_error(output)}",
    ),
    Statement(
        "low-coverage",
        lambda output: not output.is_covered,
        lambda output: (
            f"the {100 * LEVEL:g} % prediction band of {output.name} contains "
            f"{write_percent(output.coverage or 0.0)} of the validation samples"
        ),
    ),
    Statement(
        "wide-band",
        lambda output: output.is_vague,
        lambda output: f"{output.name}: {describe_wide_band()}",
    ),
    Statement(
        "error-ratio",
        lambda output: output.generalises_poorly,
        lambda output: f"{output.name}: {describe_excess(output)}",
    ),
    Statement(
        "estimation-error",
        lambda output: output.fits_poorly,
        lambda output: f"{output.name}: {describe_estimation_error(output)}",
    ),
)

#: Checks that the model fails.
FAILURES: Final[tuple[Statement[CoupledFacts], ...]] = (EXTRAPOLATION,)

#: What the model can be used for.
USES: Final[tuple[Statement[CoupledFacts], ...]] = (
    *SIMULATION_USES,
    Statement(
        "adequate-residual",
        _find_unstructured,
        lambda facts: f"no structure is left in the residual of {_list_names(_find_unstructured(facts))}",
    ),
)

#: What to do next.
NEXT_STEPS: Final[tuple[Statement[CoupledFacts], ...]] = (
    Statement(
        "other-terms",
        lambda facts: facts.structured,
        lambda facts: f"try {_suggest_models(facts)} of {_list_names(facts.structured)}",
    ),
    Statement(
        "wider-record",
        lambda facts: facts.extrapolation or any(output.generalises_poorly for output in facts.outputs),
        lambda _: "estimate from a record that covers the amplitudes and rates of the validation data",
    ),
    Statement(
        "insignificant",
        lambda facts: list_insignificant(facts.model["terms"]),
        lambda facts: (
            f"try a longer record, since {describe_insignificant(list_insignificant(facts.model['terms']))}"
        ),
    ),
    TEST,
)
