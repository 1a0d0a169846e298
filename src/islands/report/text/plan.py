"""Plan of an experiment as text."""

from collections.abc import Iterator

from islands.diagnosis.planning.alternative_experiments import choose_cheapest
from islands.diagnosis.planning.decisive_experiment import DecisiveExperiment
from islands.diagnosis.planning.experiment_plan import ExperimentPlan
from islands.diagnosis.planning.isolability import REFERENCE_MISFIT, Isolability, IsolabilityRow
from islands.report.text.layout import WIDTH, wrap
from islands.sentences import write, write_one

#: A cause is separable as soon as it is detected up to this factor of the smallest detectable strength.
_SAME = 1.05


def plan_text(plan: ExperimentPlan) -> str:
    """Return a plan as text: matrix, detectable strengths, groups, changes, and the decisive experiment.

    Sigma is the standard deviation of the noise; separations are in that of its innovations.
    """
    unit = "sigma" if plan.noise.is_white else "standard deviations of whitened noise"

    def state(group: str) -> list[str]:
        texts = write("plan", group, plan=plan, reference=REFERENCE_MISFIT, unit=unit)
        return [line for text in texts for line in wrap(text)]

    lines = [*state("head"), "", *_format_matrix(plan.isolability), ""]
    lines += [*state("strengths"), *_format_strengths(plan.isolability, plan.record.output_unit)]
    if groups := state("groups"):
        lines += ["", *groups]
    if plan.alternatives:
        lines += ["", *state("alternatives"), *_format_alternatives(plan)]
        lines += state("insufficient") if choose_cheapest(plan.alternatives) is None else []
    lines += ["", *state("end")]
    if plan.decisive is not None and not plan.left_out:
        lines += [*state("decisive"), *_format_decisive(plan.decisive)]
    return "\n".join(lines)


def _format_matrix(isolability: Isolability) -> Iterator[str]:
    """Yield the matrix with one character per cell."""
    names = isolability.names
    width = max(map(len, names)) + 4
    yield from wrap(write_one("plan", "legend", reference=REFERENCE_MISFIT))
    gap = " " if width + 2 * len(names) <= WIDTH else ""
    numbers = range(1, len(names) + 1)
    if len(names) > 9:
        yield " " * width + gap.join(str(number // 10) if number > 9 else " " for number in numbers)
    yield " " * width + gap.join(str(number % 10) for number in numbers)
    for number, name, row in zip(numbers, names, isolability.rows, strict=True):
        cells = gap.join(_format_cell(row, place, number - 1) for place in range(len(names)))
        yield f"{number:2d} {name}".ljust(width) + cells


def _format_cell(row: IsolabilityRow, place: int, own: int) -> str:
    if place == own:
        return " "
    if row.detectable is None:
        return "?"
    misfit = row.misfits[place]
    if misfit <= _SAME * row.detectable.misfit:
        return "."
    if misfit == float("inf"):
        return "#"
    return "+" if misfit <= REFERENCE_MISFIT else "x"


def _format_strengths(isolability: Isolability, unit: str) -> Iterator[str]:
    width = max(map(len, isolability.names)) + 2
    for effect, row in zip(isolability.effects, isolability.rows, strict=True):
        found = row.detectable
        if found is not None:
            size = f"{found.misfit_in_output:8.2g} {unit}".rstrip()
            value = f"{found.value:.2g} {found.unit}".rstrip()
            yield f"  {effect.name:{width}}{found.misfit:5.2f} sigma, {size}: {value}"


def _format_alternatives(plan: ExperimentPlan) -> Iterator[str]:
    for each in plan.alternatives:
        mark = "*" if each is choose_cheapest(plan.alternatives) else " "
        text = write_one("plan", "alternative", each=each, input_unit=plan.record.input_units[0])
        lines = wrap(text, " " * 11) if len(text) > WIDTH - 11 else [text]
        yield f"{mark}{each.separation.distance:8.1f}  " + "\n".join(lines)


def _format_decisive(decisive: DecisiveExperiment) -> Iterator[str]:
    for pair, before, after in zip(decisive.pairs, decisive.before, decisive.after, strict=True):
        numbers = f"{before.distance:8.1f}{after.distance:8.1f}{after.required:8.1f}"
        yield f"{numbers}  {pair.names[0]} or {pair.names[1]}"
