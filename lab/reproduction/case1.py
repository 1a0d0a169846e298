"""Case 1 of the paper (sections 6.1 and 7): the theoretical piezo of Bouc and Wen."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from matplotlib.figure import Figure

from islands.evolution.presets import PRESETS
from islands.facade.identify import identify_record
from islands.models.narx import Model, require_narx
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from islands.systems.bouc_wen import DT, authors_estimation, authors_validation
from islands.systems.catalogue import make_record
from islands.systems.published_models import PUBLISHED
from lab.reproduction.ablation import (
    LITERAL,
    SWITCHES,
    describe_range,
    median,
    selected_error,
    tabulate_ablation,
)
from lab.reproduction.figures import (
    Reproduced,
    draw_errors_by_switch,
    draw_shares,
    draw_training_data,
    draw_validation,
)
from lab.reproduction.published import (
    assess_published,
    explain_error,
    explain_parameter,
    format_error,
)
from lab.reproduction.searches import measure_errors, model_document, read_document, search_island
from lab.reproduction.section import COMPARED, WHY, ComparisonTable, Section, SectionFigure
from lab.reproduction.tasks import Document, ReproductionOptions, Task

#: Published models of case 1.
MODELS = ("12", "13")

#: Generations of the searches in the short form: of the literal search, and of the ablation.
QUICK_GENERATIONS, QUICK_ABLATION = 30, 10

#: Searches of the short form: of the literal search, and of each switch.
QUICK_SEEDS, QUICK_ABLATION_SEEDS = 2, 1

#: Parameter vectors that round to those of Table 2, in the whole and in the short form.
_DRAWS, _QUICK_DRAWS = 200, 20

#: Estimation and validation samples of the search with our preset in the short form.
_QUICK_SAMPLES = (20_000, 5_000)

#: Changes of our preset: two islands as in the demo, and those of the short form.
_OURS: Mapping[str, Any] = {"islands": 2}
_QUICK_OURS: Mapping[str, Any] = {"population": 60, "generations": 5, "islands": 1, "swap_search": False}

#: Largest numbers of terms for which our preset is compared.
_SIZES = (6, 9)

#: Samples of ten seconds, which is about the length of the paper's validation.
_TEN_SECONDS = round(10.0 / DT)

#: Seconds of a record that Figure 5 shows: three loops, and a constant input with its approach.
_LOOPS, _HOLD = slice(0, round(3.0 / DT)), slice(round(1.5 / DT), round(6.0 / DT))

#: What each error is measured on, by its name in a document.
_RECORDS = {
    "estimation": "estimation",
    "validation_10s": "validation, 10 s",
    "validation_100s": "validation, 100 s",
}


def plan(options: ReproductionOptions) -> list[Task]:
    """Return the tasks of case 1; the longest come first."""
    quick = options.quick
    seeds = range(min(options.seeds, QUICK_SEEDS) if quick else options.seeds)
    tasks = [
        Task("case1-preset", search_with_preset, (quick,)),
        Task("case1-published", assess_models, (_QUICK_DRAWS if quick else _DRAWS,)),
    ]
    whole = PRESETS["paper-case1"].generations
    for name in SWITCHES:
        generations = whole if not quick else QUICK_GENERATIONS if name == LITERAL else QUICK_ABLATION
        chosen = seeds if name == LITERAL or not quick else seeds[:QUICK_ABLATION_SEEDS]
        # The holds of a hall take a fifth of the time of a search.
        holds = name == LITERAL and not quick
        tasks += [_plan_search(name, name, seed, generations, holds) for seed in chosen]
    if quick:
        # The ablation is compared with a literal search of equal length.
        tasks += [
            _plan_search("reference", LITERAL, seed, QUICK_ABLATION, False)
            for seed in seeds[:QUICK_ABLATION_SEEDS]
        ]
    return tasks


def _plan_search(name: str, switch: str, seed: int, generations: int, simulate_holds: bool) -> Task:
    return Task(_key(name, seed), search_literally, (switch, seed, generations, simulate_holds))


def _key(name: str, seed: int) -> str:
    return f"case1-{name}-seed-{seed}"


def assess_models(draws: int) -> Document:
    """Return the errors and parameters of the published models, as printed and estimated again."""
    records = {"estimation": authors_estimation(), **_validation_records()}
    return {number: assess_published(PUBLISHED[number], records, draws) for number in MODELS}


def search_literally(name: str, seed: int, generations: int, simulate_holds: bool) -> Document:
    """Run the search of the paper with one switch changed, an entry of `SWITCHES`."""
    switch = SWITCHES[name]
    return search_island(
        *(authors_estimation(), _validation_records(), "paper-case1"),
        {**switch.changes, "generations": generations},
        *(seed, switch.root_rule, simulate_holds),
    )


def search_with_preset(quick: bool) -> Document:
    """Identify the record with the preset ``hysteresis``, and return the best model of each size limit."""
    estimation, validation = authors_estimation(), authors_validation()
    if quick:
        estimation, validation = estimation[: _QUICK_SAMPLES[0]], validation[: _QUICK_SAMPLES[1]]
    found = identify_record(
        estimation,
        validation,
        preset="hysteresis",
        engine="serial",
        **(_QUICK_OURS if quick else _OURS),
    )
    records = {
        "estimation": authors_estimation(),
        **_validation_records(),
        "sine_5hz": make_record("bouc-wen-piezo", "authors", "sine-5Hz"),
    }
    document: Document = {}
    for most in _SIZES:
        # The models are ordered by their validation error.
        best = next(each for each in found.models if each.model.size <= most)
        model = require_narx(best.assessment.final_model)
        document[str(most)] = {
            **model_document(model),
            "errors": measure_errors(model, records),
            "property_1": best.physics.property_1,
        }
    published = assess_published(PUBLISHED["13"], records, 0, printed=False)
    document["published_13"] = published["estimated"]
    return document


def _validation_records() -> dict[str, Dataset]:
    """Return the validation records; the last one selects a model."""
    validation = authors_validation()
    return {"validation_10s": validation[:_TEN_SECONDS], "validation_100s": validation}


def summarise(results: Mapping[str, Document], options: ReproductionOptions) -> Section:
    """Compare the results of the tasks with the paper.

    Parameters
    ----------
    results : mapping
        Results of the tasks of `plan` by key.
    options : ReproductionOptions
    """
    published, preset = results["case1-published"], results["case1-preset"]
    found = {name: _select(results, name) for name in SWITCHES}
    literal = found[LITERAL]
    compared = {**found, LITERAL: _select(results, "reference")} if options.quick else found
    first = literal[0]
    short = f" (short form: {first['generations']} generations)" if options.quick else ""
    ablated = compared[LITERAL][0]
    short_ablation = f" (short form: {ablated['generations']} generations)" if options.quick else ""
    figures = (
        SectionFigure(
            "figure-4a", "Figure 4 (a): training data, the authors' record", partial(_draw_training_data)
        ),
        SectionFigure(
            "figure-5",
            "Figure 5: free run of (13), estimated again; three seconds of the validation, and an input that "
            "becomes constant",
            partial(_draw_validation, published["13"]["model"]),
        ),
        SectionFigure(
            "case1-property-1",
            f"Share of the hall of fame with Property 1, with and without the root rule{short_ablation}",
            partial(
                draw_shares,
                {
                    "with the root rule": _shares(compared[LITERAL]),
                    "without the root rule": _shares(found["no-root-rule"]),
                },
            ),
        ),
        SectionFigure(
            "case1-ablation",
            f"Ablation: validation error of every search{short_ablation}",
            partial(
                draw_errors_by_switch,
                {
                    SWITCHES[name].text: [selected_error(each) for each in rows]
                    for name, rows in compared.items()
                },
                PUBLISHED["13"].mape[1],
            ),
        ),
    )
    return Section(
        "Case 1: theoretical piezo (Bouc-Wen)",
        _introduce(options, first),
        (
            _tabulate_errors(published),
            _tabulate_parameters(published),
            _tabulate_goals(literal, short),
            _tabulate_seeds(literal, short),
            _tabulate_preset(preset, options.quick),
            tabulate_ablation(compared, short_ablation),
        ),
        figures,
        {"published": published, "searches": compared, "literal": literal, "preset": preset},
    )


def _select(results: Mapping[str, Document], name: str) -> list[Document]:
    """Return the searches of a switch in the order of the seeds."""
    prefix = _key(name, 0).removesuffix("0")
    return [result for key, result in results.items() if key.startswith(prefix)]


def _introduce(options: ReproductionOptions, first: Document) -> tuple[str, ...]:
    records = (
        "The records are those of the authors' notebook: 100 s of low-pass noise for the estimation, a sine "
        "of 40 V and 1 Hz for the validation, whose length the paper does not state. MAPE and R2 are those "
        "of equations (7) and (8), in free run from the largest lag of each model on."
    )
    search = (
        f"The literal search is the preset paper-case1 on one island: {first['population']} individuals, "
        f"{first['generations']} generations, the whole record. As in section 5.1, the individuals of the "
        "hall of fame are validated, and the one with the smallest error over 100 s is selected."
    )
    short = (
        "Short form: the searches end early, and the search with the preset hysteresis has a fifth of the "
        "record. Their numbers are not those of the whole form."
    )
    return (records, search, short) if options.quick else (records, search)


def _tabulate_errors(published: Document) -> ComparisonTable:
    rows = []
    for number in MODELS:
        document, entry = published[number], PUBLISHED[number]
        for metric, printed, unit in (("mape", entry.mape, "MAPE %"), ("r2", entry.r2, "R2")):
            for record, text in _RECORDS.items():
                value = printed[0 if record == "estimation" else 1]
                rows.append(
                    (
                        f"({number}), {unit}, {text}",
                        f"{value:.5f}",
                        *(format_error(document[kind][record][metric]) for kind in ("printed", "estimated")),
                        explain_error(value, document, record, metric)
                        + _compare_lengths(document, record, metric, value),
                    )
                )
    columns = ("quantity", "published", "here, as printed", "here, estimated again", WHY)
    return ComparisonTable("Table 1: free-run errors of the published models", tuple(rows), columns)


def _compare_lengths(document: Document, record: str, metric: str, published: float) -> str:
    """Say over which length of the validation the estimated model is nearer to the published error."""
    if record != "validation_100s" or metric != "mape":
        return ""
    short, long = (
        abs(document["estimated"][each]["mape"] - published) for each in ("validation_10s", "validation_100s")
    )
    nearer = "10 s" if short < long else "100 s"
    return f" Of 10 s and 100 s, {nearer} are nearer to the published value."


def _tabulate_parameters(published: Document) -> ComparisonTable:
    rows = []
    for number in MODELS:
        for position, row in enumerate(published[number]["parameters"], start=1):
            rows.append(
                (
                    f"({number}) θ{position}: {row['term']}",
                    f"{row['printed']:.3g}",
                    f"{row['estimated']:.4g}",
                    explain_parameter(row),
                )
            )
    return ComparisonTable(
        "Table 2: parameters, by constrained least squares on the authors' record", tuple(rows)
    )


def _tabulate_goals(literal: Sequence[Document], short: str) -> ComparisonTable:
    errors = [selected_error(each) for each in literal]
    sizes = [each["selected"]["size"] for each in literal if each["selected"]]
    models = sum(each["hall"]["models"] for each in literal)
    held = [each["hall"]["property_1"] for each in literal]
    entry = PUBLISHED["13"]
    better = sum(error < entry.mape[1] for error in errors)
    converging = sum(each["hall"]["converging"] for each in literal)
    checked = (
        f"with simulated holds: {sum(held)} of {models}"
        if all(each is not None for each in held)
        else "cluster sums and roots; the short form simulates no holds"
    )
    rows = (
        (
            f"median MAPE % of {len(errors)} seeds, validation, 100 s",
            f"{entry.mape[1]:.5f}",
            f"{median(errors):.4f}",
            f"{better} of {len(errors)} seeds have a smaller error than the paper, which shows one search",
        ),
        (
            "largest MAPE %",
            "-",
            f"{max(errors):.4f}",
            f"{max(errors) / entry.mape[1]:.2f} times the published error",
        ),
        (
            "terms",
            str(entry.model.size),
            describe_range(sizes),
            (
                f"{sum(size == entry.model.size for size in sizes)} of {len(literal)} seeds have "
                f"{entry.model.size} terms: the validation selects among all sizes"
            ),
        ),
        ("final hall with Property 1", "-", f"{converging} of {models}", checked),
    )
    return ComparisonTable(f"The literal search{short}", rows, COMPARED)


def _tabulate_seeds(literal: Sequence[Document], short: str) -> ComparisonTable:
    entry = PUBLISHED["13"]
    rows: list[tuple[str, ...]] = [
        (
            "(13), published",
            str(entry.model.size),
            f"{entry.mape[0]:.5f}",
            *(f"{entry.mape[1]:.5f}",) * 2,
            "-",
            "the reference; the seed of the authors' search is not published",
        )
    ]
    for each in literal:
        selected = each["selected"]
        share = f"{each['hall']['converging']} of {each['hall']['models']}"
        if selected is None:
            rows.append((f"seed {each['seed']}", *("-",) * 4, share, "every model of the hall diverges"))
            continue
        errors = selected["errors"]
        ratio = selected_error(each) / entry.mape[1]
        terms = selected["size"] - entry.model.size
        rows.append(
            (
                f"seed {each['seed']}",
                str(selected["size"]),
                *(format_error(errors[record]["mape"], 4) for record in _RECORDS),
                share,
                f"another random sequence: {ratio:.2f} times the published error, {_compare_sizes(terms)}",
            )
        )
    columns = (
        "search",
        "terms",
        *(f"MAPE %, {text}" for text in _RECORDS.values()),
        "hall with Property 1",
        WHY,
    )
    return ComparisonTable(f"The literal search, seed by seed{short}", tuple(rows), columns)


def _compare_sizes(difference: int) -> str:
    """Compare a number of terms with another one in words."""
    if not difference:
        return "as many terms"
    noun = "term" if abs(difference) == 1 else "terms"
    return f"{abs(difference)} {'more' if difference > 0 else 'fewer'} {noun}"


def _tabulate_preset(preset: Document, quick: bool) -> ComparisonTable:
    rows = []
    reference = preset["published_13"]
    for most, number in zip(_SIZES, MODELS, strict=True):
        found = preset[str(most)]
        for record, text in {**_RECORDS, "sine_5hz": "sine of 5 Hz, test"}.items():
            error = found["errors"][record]["mape"]
            printed = PUBLISHED[number].mape
            value = printed[0 if record == "estimation" else 1] if record in _RECORDS else None
            compared = value if value is not None else reference[record]["mape"]
            name = f"the published ({number})" if value is not None else "(13), estimated again"
            rows.append(
                (
                    f"at most {most} terms: {text}",
                    "-" if value is None else f"{value:.5f}",
                    format_error(error, 4),
                    _compare(error, compared, name, found["size"]),
                )
            )
    short = " (short form)" if quick else ""
    return ComparisonTable(f"Our preset hysteresis: MAPE %{short}", tuple(rows))


def _compare(error: float | None, reference: float | None, name: str, size: int) -> str:
    """Compare an error with a reference in words."""
    if error is None or reference is None:
        return "a free run diverges"
    return (
        f"{error / reference:.2f} times the error of {name} ({reference:.4f}), with {size} terms: seeded by "
        "forward selection, refined by the shooting error"
    )


def _shares(searches: Sequence[Document]) -> list[tuple[list[int], list[float]]]:
    return [
        (
            [point["generation"] for point in each["trace"]],
            [100.0 * point["converging"] / max(point["models"], 1) for point in each["trace"]],
        )
        for each in searches
    ]


def _draw_training_data(theme: str) -> Figure:
    return draw_training_data(authors_estimation(), theme)


def _draw_validation(document: Document, theme: str) -> Figure:
    validation = authors_validation()
    model = read_document(document, validation)
    loading, unloading = (
        _reproduce(model, make_record("bouc-wen-piezo", "authors", f"hold-{side}"))[_HOLD]
        for side in ("loading", "unloading")
    )
    return draw_validation(_reproduce(model, validation)[_LOOPS], loading, unloading, theme)


def _reproduce(model: Model, record: Dataset) -> Reproduced:
    return Reproduced(record, free_run(model, record).y)
