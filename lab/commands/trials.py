"""``islands trials``: blind fault-injection trials of the discrepancy analysis."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import numpy as np
import typer

from islands.cli.console import output
from islands.cli.engines import check_engine
from islands.cli.progress_display import compile_kernels, progress
from islands.cli.stop_requests import stop_requests
from islands.errors import SettingsError, lookup
from islands.progress import Steps, StoppedError
from islands.report.figures.style import save
from lab.diagnosis.cases import CASES, SimulatedCase
from lab.diagnosis.confusion import draw_confusion
from lab.diagnosis.injection.noise import NOISES
from lab.diagnosis.injection.unusual.table import UNUSUAL_CAUSES
from lab.diagnosis.score_table import make_score_table
from lab.diagnosis.scoring import (
    Proportion,
    ReliabilityBin,
    Statistic,
    confusion,
    reliability,
    score,
)
from lab.diagnosis.trial import Trial, TrialOutcome, run_trial
from lab.diagnosis.unusual_report import plan_unusual, report_unusual
from lab.diagnosis.unusual_trial import run_unusual_trial
from lab.parallel_map import open_pool

Planned = TypeVar("Planned")
Outcome = TypeVar("Outcome")

#: Bands of the misfit of an effect, in standard deviations of the noise; used in turn.
BANDS = ((0.2, 1.0), (1.0, 4.0), (0.05, 0.2))

#: Band of effects that are injected together.
COMBINED_BAND = BANDS[1]

#: Faults that act after others, in this order: disturbances act behind the actuator, and an encoder reads the
#: position that drifts and disturbances have moved.
LAST = ("second-input", "swept-disturbance", "periodic-disturbance", "swept-interference", "cyclic-error")


class _Counts(NamedTuple):
    """Numbers of trials of a simulation: of each effect, without an effect, and of the other kinds."""

    each: int
    clean: int
    open_set: int
    pairs: int
    triples: int
    mixed: int


def trials(
    cores: Annotated[
        list[str] | None,
        typer.Option("--core", help=f"Simulation; repeatable: {', '.join(CASES)}; the first by default."),
    ] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option(
            "--effects",
            help="Effects to inject, or unusual causes; repeatable; by default, or by 'all', all that the "
            "analysis can name, or all unusual causes.",
        ),
    ] = None,
    count: Annotated[int, typer.Option("--count", min=1, help="Trials of each effect.")] = 3,
    noise: Annotated[
        str, typer.Option("--noise", help=f"Kind of the measurement noise: {', '.join(NOISES)}.")
    ] = "white",
    clean: Annotated[int, typer.Option("--clean", min=0, help="Records without an effect.")] = 20,
    pairs: Annotated[int, typer.Option("--pairs", min=0, help="Records with two effects.")] = 0,
    triples: Annotated[int, typer.Option("--triples", min=0, help="Records with three effects.")] = 0,
    open_set: Annotated[
        int,
        typer.Option("--open-set", min=0, help="Records of each cause that is not in the catalogue."),
    ] = 2,
    mixed: Annotated[
        int,
        typer.Option(
            "--mixed", min=0, help="Records with an effect and a cause that is not in the catalogue."
        ),
    ] = 0,
    unusual: Annotated[
        int,
        typer.Option(
            "--unusual",
            min=0,
            help="Plants with each unusual cause, instead of all other trials: causes that are mostly not in "
            "the catalogue, and clean records of unusual noise. What is found is tested on another record.",
        ),
    ] = 0,
    variant: Annotated[
        bool, typer.Option("--variant", help="Inject effects in other forms than those of the catalogue.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the random generator.")] = 0,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds", min=10.0, help="Length of a record; by default the usual length of its system."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Largest number of trials that run in parallel.")
    ] = None,
    address: Annotated[str | None, typer.Option("--ray-address", help="HOST:PORT of a cluster.")] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="SVG file for the confusion matrix.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--json", help="JSON file for the outcomes.")] = None,
) -> None:
    """Inject effects into simulated records, diagnose them, and count how often they are found and named."""
    cases = {name: lookup(CASES, name, "core") for name in cores or [next(iter(CASES))]}
    run_all = partial(_run_all, workers=workers, address=address, out=out)
    if unusual:
        chosen = [
            lookup(UNUSUAL_CAUSES, name, "unusual cause").name for name in effects or () if name != "all"
        ]
        run_all(run_unusual_trial, plan_unusual(cores or (), chosen, unusual, seed), report=report_unusual)
        return
    lookup(NOISES, noise, "noise")
    counts = _Counts(count, clean, open_set, pairs, triples, mixed)
    planned = [
        Trial(injected, seed + turn, noise, band, variant and band is not None, seconds, core, oracle=True)
        for core, simulated in cases.items()
        for injected, turn, band in _plan_injections(
            simulated, _select_effects(effects, simulated), counts, np.random.default_rng(seed)
        )
    ]

    def report(found: Sequence[TrialOutcome]) -> dict[str, Any]:
        document: dict[str, Any] = {"cores": {}, "outcomes": [asdict(each) for each in found]}
        for core, simulated in cases.items():
            outcomes = [each for each in found if each.trial.core == core]
            document["cores"][core] = _report_case(core, simulated, outcomes)
            if figure is not None:
                path = figure if len(cases) == 1 else figure.with_stem(f"{figure.stem}-{core}")
                title = f"{core}, {noise} noise: injected and named effects"
                save(draw_confusion(confusion(outcomes), simulated.nameable, title), path)
        return document

    run_all(run_trial, planned, report=report)


def _run_all(
    run: Callable[[Planned], Outcome],
    planned: Sequence[Planned],
    report: Callable[[Sequence[Outcome]], dict[str, Any]],
    workers: int | None,
    address: str | None,
    out: Path | None,
) -> None:
    """Run trials in parallel and report their outcomes; a stop request leaves out those not begun."""
    check_engine(None, address)
    compile_kernels()
    found: list[Outcome] = []
    with progress("trials") as show, stop_requests() as stop:
        steps = Steps(show, stop)
        check = partial(steps.check, "the first trial")
        with suppress(StoppedError), open_pool(workers, address, check) as parallel_map:
            for outcome in parallel_map(run, planned):
                found.append(outcome)
                show(f"{len(found)} of {len(planned)}", len(found) / len(planned))
        if not found:
            check()
    document = report(found)
    if out is not None:
        out.write_text(json.dumps(document, indent=1))
    left_out = [f"{len(planned) - len(found)} of {len(planned)} trials"] * (len(found) < len(planned))
    stop.end(out, left_out, "repeat the command for all trials")


def _plan_injections(
    simulated: SimulatedCase, names: Sequence[str], counts: _Counts, rng: np.random.Generator
) -> Iterator[tuple[tuple[str, ...], int, tuple[float, float] | None]]:
    """Yield the causes that each trial injects, its number, and the band of the misfit of its effects."""
    for name in names:
        for turn in range(counts.each):
            yield (name,), turn, BANDS[turn % len(BANDS)]
    for turn in range(counts.clean):
        yield (), turn, None
    for name in simulated.system.unknown:
        for turn in range(counts.open_set):
            yield (name,), turn, None
    for size, many in ((2, counts.pairs), (3, counts.triples)):
        if many and len(names) < size:
            raise SettingsError(f"{size} effects at once need {size} names: give more with --effects")
        for turn in range(many):
            drawn = map(str, rng.choice(names, size, replace=False))
            yield tuple(sorted(drawn, key=_get_place)), turn, COMBINED_BAND
    for turn in range(counts.mixed):
        yield tuple(str(rng.choice(each)) for each in (names, simulated.nameless)), turn, COMBINED_BAND


def _get_place(name: str) -> int:
    """Return the place of a fault among those that act after others; 0 for another one."""
    return LAST.index(name) + 1 if name in LAST else 0


def _report_case(core: str, simulated: SimulatedCase, outcomes: Sequence[TrialOutcome]) -> dict[str, Any]:
    """Print the scores of one simulation and return them as a document."""
    rows = score(outcomes, simulated.nameless, simulated.goals)
    bins = reliability(outcomes)
    output.print(make_score_table(core, rows))
    for each in bins:
        output.print(_format_bin(each), markup=False)
    wrong = {key: times for key, times in sorted(confusion(outcomes).items()) if key[0] != key[1]}
    for (injected, named), times in islice(wrong.items(), 40):
        output.print(f"{injected or 'nothing'} was named {named or 'nothing'}: {times}", markup=False)
    shares = [{**asdict(each), "bounds": each.bounds} for each in rows if isinstance(each, Proportion)]
    measures = [asdict(each) for each in rows if isinstance(each, Statistic) and each.of]
    return {"shares": shares, "measures": measures, "reliability": [asdict(each) for each in bins]}


def _select_effects(effects: list[str] | None, simulated: SimulatedCase) -> list[str]:
    if not effects or effects == ["all"]:
        return list(simulated.nameable)
    for name in effects:
        lookup(dict.fromkeys(simulated.system.known), name, "effect")
    return effects


def _format_bin(each: ReliabilityBin) -> str:
    return (
        f"confidence {each.low:g} to {each.high:g}: {each.count} names, said {100 * each.said:.0f} %, "
        f"right {100 * each.right:.0f} %"
    )
