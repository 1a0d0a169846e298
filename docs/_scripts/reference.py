"""Generated reference: tables of the core and of the service, and the index of all reference pages.

Every list comes from a table of the code. The other modules ``reference_*`` generate the longer pages.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, asdict
from pathlib import Path
from typing import Any

import reference_api
import reference_cli
import reference_discrepancy
import reference_rest
from tables import code, codes, entries, escape, page, section, summarise, table

from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.migration import REPLACEMENT_POLICIES, SELECTION_POLICIES, TOPOLOGIES, WITH_DEGREE
from islands.evolution.presets import PRESET_SUMMARIES, PRESETS
from islands.evolution.settings import FITNESSES, ISLAND_PROFILES, Settings
from islands.export import EXPORTS, FILE_EXPORTS
from islands.expressions.primitives import PRIMITIVES
from islands.models.candidate_library import LIBRARIES
from islands.models.latent import STRUCTURE_SUMMARIES
from islands.records.reading import READERS
from islands.report.figures.registry import FIGURES, SEARCH_FIGURES
from islands.settings_schema import list_settings
from islands.systems.catalogue import SYSTEMS
from islands.systems.published_models import PUBLISHED
from islands_service.engines import ENGINES
from islands_service.settings import ServiceSettings

DOCS = Path(__file__).parents[1]


def search_settings() -> str:
    """Return the page of presets and settings of a search."""
    return page(
        "Settings",
        "Presets and settings. A preset of a search is a set of settings; each can be changed, too: by "
        "`--set NAME=VALUE`, by the argument of a function in Python, and in `settings` of `POST /v1/jobs`.",
        section("Presets", _presets()),
        *(
            section(_title(cls), f"Of {codes(names)}.", _settings(cls))
            for cls, names in reference_cli.settings().items()
            if cls is not ServiceSettings  # which have a page
        ),
        section("Gene structures", "Values of `structure`.", entries("Structure", STRUCTURES)),
        section(
            "Structures of latent models",
            "Values of `structure` with the preset `latent`.",
            table(
                ("Structure", "Meaning"), ((code(name), text) for name, text in STRUCTURE_SUMMARIES.items())
            ),
        ),
        section("Fitnesses", "Values of `fitness`.", entries("Fitness", FITNESSES)),
        section("Parameter constraints", "Values of `constraints`.", entries("Constraint", CONSTRAINTS)),
        section("Candidate libraries", "Values of `library`, and of `islands fit --library`.", _libraries()),
    )


def _title(cls: type) -> str:
    return str(cls.__doc__).partition(":")[0].partition(".")[0].replace("`", "")


def _settings(cls: type) -> str:
    rows = (
        (code(name), values, code(_shown(info.default)), escape(str(info.description)))
        for name, info, values in list_settings(cls)
    )
    return table(("Setting", "Values", "Default", "Meaning"), rows)


def _presets() -> str:
    default = asdict(Settings())
    rows = []
    for name, preset in PRESETS.items():
        changed = {key: value for key, value in asdict(preset).items() if value != default[key]}
        shown = codes(f"{key}={_shown(value)}" for key, value in changed.items())
        rows.append((code(name), escape(PRESET_SUMMARIES[name]), shown or "none"))
    return table(("Preset", "For", "Settings that differ from the defaults"), rows)


def _libraries() -> str:
    rows = (
        (code(name), escape(summarise(each)), str(each.degree), str(each.lags), code(each.constraints))
        for name, each in LIBRARIES.items()
    )
    return table(("Library", "Candidates", "Degree", "Lags", "Usual constraint"), rows)


def islands() -> str:
    """Return the page of topologies, migration policies, profiles and engines."""
    degrees = " or ".join(WITH_DEGREE)
    profiles = (
        (code(name), codes(f"{key}={_shown(value)}" for key, value in changes.items()) or "none")
        for name, changes in ISLAND_PROFILES.items()
    )
    return page(
        "Islands",
        "Topologies, migration policies, island profiles and engines. [Settings of a search](settings.md) "
        "has the settings that choose them.",
        section(
            "Topologies",
            "Values of `topology`. A list of edges is a topology, too: `0>1,1>2` sends from island 0 to 1 "
            f"and from 1 to 2. A degree may follow {code(degrees)}: `{WITH_DEGREE[0]}:4`.",
            entries("Topology", TOPOLOGIES),
        ),
        section(
            "Selection of emigrants",
            "Values of `emigrants`: which individuals are copied to the neighbours.",
            entries("Policy", SELECTION_POLICIES),
        ),
        section(
            "Replacement by immigrants",
            "Values of `replaced`: which individuals of the population immigrants replace.",
            entries("Policy", REPLACEMENT_POLICIES),
        ),
        section(
            "Island profiles",
            "Values of `characters`. A profile changes settings of variation and selection on its island; "
            "fitness, constraints and sizes are the same on all islands.",
            table(("Profile", "Changed settings"), profiles),
        ),
        section(
            "Engines",
            "Values of `--engine`. The result has the same bits with every engine.",
            entries("Engine", ENGINES),
        ),
    )


def primitives() -> str:
    """Return the page of the primitives."""
    rows = (
        (
            code(name),
            code(f"{name}({', '.join('ab'[: each.arity])})"),
            escape(each.summary),
            {1: "even", -1: "odd", 0: ""}[each.parity],
            "yes" if each.commutative else "",
        )
        for name, each in PRIMITIVES.items()
    )
    return page(
        "Primitives",
        "Functions that may occur in expressions, by names that `primitives` and `islands.parse` take.",
        table(("Primitive", "Call", "Value", "Parity", "Commutative"), rows),
        "`islands.primitive` defines further ones: see [expressions](expressions.md).\n",
    )


def systems() -> str:
    """Return the page of simulated systems and published models."""
    rows = (
        (code(name), escape(each.description), codes(each.variants), codes(each.parts))
        for name, each in SYSTEMS.items()
    )
    models = (
        (code(f"published:{name}"), escape(each.source), *(f"{error:g}" for error in each.mape))
        for name, each in PUBLISHED.items()
    )
    return page(
        "Systems and published models",
        "Simulated systems of `islands examples --system`, and models that the paper publishes.",
        section("Systems", table(("System", "Meaning", "Variants", "Parts"), rows)),
        section(
            "Published models",
            "Accepted instead of a model file. The errors are MAPE of the free run in percent (Table 1).",
            table(("Model", "Source", "Estimation", "Validation"), models),
        ),
    )


def output_formats() -> str:
    """Return the page of export formats and figures."""
    return page(
        "Export formats and figures",
        "Formats of `islands show --format`, `export` in Python and over REST; figures of a result.",
        section("Export formats", entries("Format", {**EXPORTS, **FILE_EXPORTS})),
        section("Figures of a model", "`best.plot(name)` draws them in Python.", entries("Figure", FIGURES)),
        section("Figures of a search", entries("Figure", SEARCH_FIGURES)),
        section("Record formats", "[Records](records.md) has the details.", entries("Suffix", READERS)),
    )


def service_settings() -> str:
    """Return the page of the service's settings."""
    prefix = ServiceSettings.model_config["env_prefix"]
    rows = (
        (code(f"{prefix}{name.upper()}"), values, _default(info), escape(str(info.description)))
        for name, info, values in list_settings(ServiceSettings)
    )
    return page(
        "Settings of the service",
        "Environment variables that all roles of the service read; `islands serve` has options for the most "
        "common ones, and `--set` for all. Units are bytes, seconds and counts.",
        table(("Variable", "Values", "Default", "Meaning"), rows),
    )


def _default(field: Any) -> str:
    if field.default_factory is not None:
        return "see there"
    return "" if field.default in (None, "") else code(_shown(field.default))


def _shown(value: object) -> str:
    match value:
        case tuple() | dict():
            return ",".join(map(str, value)) or "none"
        case "":
            return "none"
        case float():
            return f"{value:g}"
    return "" if value is MISSING else str(value)


#: Generated pages by their path, in the order of the index.
PAGES: Mapping[str, Callable[[], str]] = {
    "reference/api.md": reference_api.python,
    "reference/client.md": reference_api.client,
    "reference/cli.md": reference_cli.cli,
    "reference/settings.md": search_settings,
    "reference/islands.md": islands,
    "reference/primitives.md": primitives,
    "reference/effects.md": reference_discrepancy.effects,
    "reference/simulators.md": reference_discrepancy.simulators,
    "reference/systems.md": systems,
    "reference/output-formats.md": output_formats,
    "reference/rest.md": reference_rest.rest,
    "reference/problems.md": reference_rest.problems,
    "reference/service-settings.md": service_settings,
}


def make_pages() -> Iterator[tuple[str, str]]:
    """Yield the path below ``docs/`` and the text of every generated page."""
    found = {path: generate() for path, generate in PAGES.items()}
    written = {
        f"reference/{path.name}": path.read_text("utf-8")
        for path in sorted((DOCS / "reference").glob("*.md"))
    }
    yield "reference/index.md", index({**found, **written})
    yield from found.items()


def index(found: Mapping[str, str]) -> str:
    """Return the page that lists all reference pages with their titles and first sentences."""
    return page(
        "Reference",
        "Tables and interfaces. Most of these pages are generated from the code.",
        table(("Page", "Content"), map(_index_row, found.items())),
    )


def _index_row(item: tuple[str, str]) -> Iterable[str]:
    path, text = item
    title, introduction = text.split("\n\n")[:2]
    return f"[{title.removeprefix('# ')}]({path.removeprefix('reference/')})", " ".join(introduction.split())
