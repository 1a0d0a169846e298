"""Plan of an experiment as text."""

from collections.abc import Iterator

from islands.diagnosis.planning.alternative_experiments import AlternativeExperiment, choose_cheapest
from islands.diagnosis.planning.channel_noise import NoiseOrigin
from islands.diagnosis.planning.decisive_experiment import DecisiveExperiment
from islands.diagnosis.planning.experiment_plan import ExperimentPlan
from islands.diagnosis.planning.isolability import REFERENCE_MISFIT, Isolability, IsolabilityRow
from islands.report.text.layout import WIDTH, wrap

#: A cause is separable as soon as it is detected up to this factor of the smallest detectable strength.
_SAME = 1.05

_ORIGINS = {
    NoiseOrigin.GIVEN: "as given",
    NoiseOrigin.PERIODS: "measured between repeated periods",
    NoiseOrigin.RESIDUAL: "an upper bound, from the residual of the calibrated simulation",
}

_LEGEND = (
    ". separable when detected   + from a misfit of up to 1 sigma on   x from more than 1 sigma on   "
    "# at no strength   ? not detectable"
)


def plan_text(plan: ExperimentPlan) -> str:
    """Return a plan as text: matrix, detectable strengths, groups, changes, and the decisive experiment.

    Sigma is the standard deviation of the noise; separations are in that of its innovations.
    """
    record, unit = plan.record, plan.record.output_unit
    given = f"{plan.simulation}, input {record.input_names[0]}: {record.samples} samples of {record.dt:g} s"
    lines = [*wrap(given), *wrap(_describe_noise(plan))]
    lines += ["", *_format_matrix(plan.isolability), "", *_format_strengths(plan.isolability, unit)]
    groups, absorbed = plan.isolability.groups, plan.isolability.undetectable
    if groups or absorbed:
        lines.append("")
    for group in groups:
        lines += wrap(f"Not separable at any strength: {', '.join(group)}")
    if absorbed:
        lines += wrap(f"Not detectable, since calibration absorbs them: {', '.join(absorbed)}")
    if plan.alternatives:
        lines += ["", *_format_alternatives(plan)]
    lines.append("")
    if plan.left_out:
        lines += wrap(f"Left out: {', '.join(plan.left_out)}.")
    elif plan.decisive is None:
        lines += wrap(f"All causes are separable at {REFERENCE_MISFIT:g} sigma: this input is sufficient.")
    else:
        lines += _format_decisive(plan.decisive, _name_unit(plan))
    return "\n".join(lines)


def _describe_noise(plan: ExperimentPlan) -> str:
    noise, record = plan.noise, plan.record
    size = f"sigma = {noise.std:.3g} {record.output_unit}".rstrip()
    slowest = f"{noise.time_constant * record.dt:.2g} s"
    colour = "white" if noise.is_white else f"coloured, AR({noise.model.order}), time constant {slowest}"
    return f"Noise of the output: {size}, {colour}; {_ORIGINS[noise.origin]}"


def _format_matrix(isolability: Isolability) -> Iterator[str]:
    """Yield the matrix with one character per cell."""
    names = isolability.names
    width = max(map(len, names)) + 4
    yield from wrap(f"Is the cause of a row separable from that of a column? {_LEGEND}", "")
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
    yield "Detectable from this misfit on (root mean square after calibration):"
    width = max(map(len, isolability.names)) + 2
    for effect, row in zip(isolability.effects, isolability.rows, strict=True):
        found = row.detectable
        if found is not None:
            size = f"{found.misfit_in_output:8.2g} {unit}".rstrip()
            value = f"{found.value:.2g} {found.unit}".rstrip()
            yield f"  {effect.name:{width}}{found.misfit:5.2f} sigma, {size}: {value}"


def _format_alternatives(plan: ExperimentPlan) -> Iterator[str]:
    one, other = plan.pair
    required = plan.alternatives[0].separation.required
    yield from wrap(
        f"{one} or {other} at {REFERENCE_MISFIT:g} sigma: separation in {_name_unit(plan)} with other "
        f"experiments, the cheapest first; {required:.1f} are required"
    )
    unit = plan.record.input_units[0]
    for each in plan.alternatives:
        mark = "*" if each is choose_cheapest(plan.alternatives) else " "
        yield f"{mark}{each.separation.distance:8.1f}  {_format_change(each, unit)}"
    if choose_cheapest(plan.alternatives) is None:
        yield "None of them is sufficient."


def _format_change(each: AlternativeExperiment, unit: str) -> str:
    text = f"{each.change} ({each.duration:.3g} s, at most {each.rate:.2g} {unit or '1'}/s)"
    return "\n".join(wrap(text, " " * 11)) if len(text) > WIDTH - 11 else text


def _name_unit(plan: ExperimentPlan) -> str:
    """Return the unit of separations: white noise is its innovations."""
    return "sigma" if plan.noise.is_white else "standard deviations of whitened noise"


def _format_decisive(decisive: DecisiveExperiment, unit: str) -> Iterator[str]:
    yield from wrap(f"Decisive experiment: {decisive.description}, {decisive.u.size * decisive.dt:.3g} s")
    yield from wrap(f"Separation in {unit} with the given input, with this one, and the required one:")
    for pair, before, after in zip(decisive.pairs, decisive.before, decisive.after, strict=True):
        numbers = f"{before.distance:8.1f}{after.distance:8.1f}{after.required:8.1f}"
        yield f"{numbers}  {pair.names[0]} or {pair.names[1]}"
