"""The documentation agrees with the repository: links, navigation, code, commands and tables."""

import ast
import builtins
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from project_pages import GENERATED, adapt_links
from tables import summarise

from islands.diagnosis.inference.noise_detectors import DETECTORS
from islands.effects.catalogue import CATALOGUE, OF_EACH
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.migration import REPLACEMENT_POLICIES, SELECTION_POLICIES, TOPOLOGIES
from islands.evolution.presets import PRESET_SUMMARIES, PRESETS
from islands.evolution.settings import FITNESSES, Settings
from islands.export import EXPORTS
from islands.models.candidate_library import LIBRARIES
from islands.records.reading import READERS
from islands.report.figures.registry import FIGURES, SEARCH_FIGURES
from islands.settings_schema import list_settings
from islands.simulators.specification.table import SIMULATORS
from islands.systems.catalogue import SYSTEMS
from islands.systems.published_models import PUBLISHED
from islands_service.engines import ENGINES
from islands_service.settings import ServiceSettings
from support import pages
from support.pages import PAGES, page_name
from support.repository import DOCS, ROOT

PYTHON_BLOCKS = [
    pytest.param(code, id=f"{page_name(page)}-{place}")
    for page in PAGES
    for place, (language, code) in enumerate(pages.blocks(page))
    if language == "python"
]


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_links_of_a_page_lead_to_files_and_anchors(page: Path) -> None:
    for target in pages.links(page):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        # The anchors of a generated page are those of the site, whose build checks them.
        assert not anchor or file.suffix != ".md" or anchor in pages.anchors(file), target


def test_a_link_to_the_source_of_a_page_leads_to_the_page_in_the_site() -> None:
    text = "[effects](../../src/islands/effects/catalogue.py#free-forms), [first](../../examples/01_first.py)"
    assert adapt_links(text, "docs/how-to/page.md") == (
        "[effects](../reference/effects.md#free-forms), [first](../tutorials/01_first.md)"
    )
    assert adapt_links("[install](docs/how-to/a.md), [licence](LICENSE)", "README.md") == (
        "[install](how-to/a.md), licence"
    )
    assert {*GENERATED} <= pages.site_pages()
    assert all((ROOT / source).exists() for source in GENERATED.values())


def test_every_written_page_is_in_the_navigation() -> None:
    assert pages.written_pages() <= pages.site_pages()


def test_the_search_finds_an_entry_for_what_newcomers_ask() -> None:
    """The search of the site prefers words in headings."""
    asked = {"overfitting", "extrapolation", "nan", "divergence", "dead-time", "gross-error", "arx"}
    assert asked <= pages.anchors(DOCS / "glossary.md")


def test_every_page_of_the_navigation_exists_or_is_generated() -> None:
    missing = [page for page in pages.site_pages() - pages.written_pages() if not pages.is_generated(page)]
    assert not missing


def test_pictures_are_small_and_all_are_shown() -> None:
    shown = "".join(page.read_text("utf-8") for page in PAGES)
    for picture in (DOCS / "pictures").iterdir():
        assert f"pictures/{picture.name}" in shown
        assert picture.stat().st_size < 200_000, picture


@pytest.mark.parametrize("code", PYTHON_BLOCKS)
def test_python_blocks_compile(code: str) -> None:
    compile(code, "block", "exec")


@pytest.mark.parametrize("code", PYTHON_BLOCKS)
def test_self_contained_python_blocks_run(code: str) -> None:
    if undefined_names(code) or re.search(r"[\w*]\.(csv|json|html|svg)\"|http://", code):
        pytest.skip("the block needs a file, a service or the block before it")
    exec(compile(code, "block", "exec"), {})


def undefined_names(code: str) -> set[str]:
    """Return the names that a block reads and does not define."""
    nodes = list(ast.walk(ast.parse(code)))
    defined = {node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    defined |= {node.arg for node in nodes if isinstance(node, ast.arg)}
    defined |= {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    imports = [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
    defined |= {(each.asname or each.name).partition(".")[0] for node in imports for each in node.names}
    return {node.id for node in nodes if isinstance(node, ast.Name)} - defined - set(dir(builtins))


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_make_targets_of_a_page_exist(page: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE))
    used = {command.split()[1] for command in pages.commands(page) if command.startswith("make ")}
    assert used <= targets


@pytest.mark.parametrize(
    "table",
    [
        *(
            CONSTRAINTS,
            STRUCTURES,
            FITNESSES,
            LIBRARIES,
            SYSTEMS,
            PUBLISHED,
            FIGURES,
            SEARCH_FIGURES,
            EXPORTS,
        ),
        *(READERS, TOPOLOGIES, SELECTION_POLICIES, REPLACEMENT_POLICIES, ENGINES, CATALOGUE, OF_EACH),
        *(DETECTORS, SIMULATORS),
    ],
    ids=lambda table: next(iter(table)),
)
def test_every_table_entry_has_a_summary_for_the_reference(table: Mapping[str, Any]) -> None:
    assert not [name for name, entry in table.items() if not summarise(entry)]


def test_every_preset_has_a_summary() -> None:
    assert PRESET_SUMMARIES.keys() == PRESETS.keys()
    assert all(PRESET_SUMMARIES.values())


@pytest.mark.parametrize("settings", [Settings, ServiceSettings])
def test_every_setting_is_described(settings: type) -> None:
    assert not [name for name, info, _ in list_settings(settings) if not info.description]


def test_every_effect_lists_similar_effects_and_a_distinction() -> None:
    for entry in [*CATALOGUE.values(), *OF_EACH.values(), *DETECTORS.values()]:
        assert entry.similar_to, entry.name
        assert entry.distinguished_by, entry.name


def test_the_page_on_records_names_every_suffix() -> None:
    page = (DOCS / "reference" / "records.md").read_text("utf-8")
    assert not [suffix for suffix in READERS if f"`{suffix}`" not in page]
