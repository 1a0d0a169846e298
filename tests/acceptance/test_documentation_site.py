"""The site builds without warnings, loads nothing from other hosts, and has every table entry."""

import os
import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

import islands
import islands_api
from islands.diagnosis.inference.noise_detectors import DETECTORS
from islands.effects.catalogue import CATALOGUE, OF_EACH
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.migration import REPLACEMENT_POLICIES, SELECTION_POLICIES, TOPOLOGIES
from islands.evolution.presets import PRESETS
from islands.evolution.settings import FITNESSES, ISLAND_PROFILES, Settings
from islands.export import EXPORTS
from islands.expressions.primitives import PRIMITIVES
from islands.models.candidate_library import LIBRARIES
from islands.records.reading import READERS
from islands.report.figures.registry import FIGURES, SEARCH_FIGURES
from islands.simulators.specification.table import SIMULATORS
from islands.systems.catalogue import SYSTEMS
from islands.systems.published_models import PUBLISHED
from islands_api.web.problems import PROBLEMS
from islands_service.engines import ENGINES
from support.repository import ROOT

pytestmark = pytest.mark.ci

#: Names that each generated page has as code.
NAMES = {
    "settings": [*PRESETS, *STRUCTURES, *FITNESSES, *CONSTRAINTS, *LIBRARIES, *Settings.__dataclass_fields__],
    "islands": [*TOPOLOGIES, *SELECTION_POLICIES, *REPLACEMENT_POLICIES, *ISLAND_PROFILES, *ENGINES],
    "primitives": [*PRIMITIVES],
    "effects": [*CATALOGUE, *OF_EACH, *DETECTORS],
    "simulators": [entry.name + entry.argument for entry in SIMULATORS.values()],
    "systems": [*SYSTEMS, *(f"published:{name}" for name in PUBLISHED)],
    "problems": [problem.type for problem in PROBLEMS.values()],
    "output-formats": [*EXPORTS, *FIGURES, *SEARCH_FIGURES, *READERS],
}

#: Elements and attributes by which a page loads something, and imports and addresses in style sheets.
LOADS = re.compile(
    r"<(?:link(?![^>]*rel=\"?(?:canonical|next|prev))|script|img|iframe|source|video|audio|object)\b[^>]*?"
    r"\b(?:href|src|data)=[\"']?(?:https?:)?//[^\s\"'>]+|@import\s+[\"']?(?:url\()?[\"']?(?:https?:)?//[^\s\"');]+"
    r"|url\([\"']?(?:https?:)?//[^)]+\)"
)


@pytest.fixture(scope="module")
def generated() -> dict[str, str]:
    import reference

    return dict(reference.make_pages())


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site. The proxy does not exist, so a build that needs the network fails."""
    pytest.importorskip("mkdocs", reason="MkDocs is not installed: run: make .venv/ready-docs")
    folder = tmp_path_factory.mktemp("site")
    nowhere = "http://127.0.0.1:9"
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env={
            **os.environ,
            **dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), nowhere),
            "no_proxy": "127.0.0.1,localhost",
            "NO_MKDOCS_2_WARNING": "1",
            "PATH": f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}",
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    assert "WARNING" not in done.stderr
    assert done.stdout == ""
    return folder


@pytest.mark.nightly
@pytest.mark.timeout(1200)
def test_no_page_loads_anything_from_another_host(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 30
    for file in [*pages, *site.rglob("*.css")]:
        text = file.read_text("utf-8")
        assert not LOADS.findall(text), file
        # The theme would fetch Mermaid from another host.
        assert 'class="mermaid"' not in text, file


@pytest.mark.nightly
@pytest.mark.timeout(1200)
def test_the_site_has_a_search_index_and_every_public_name(site: Path) -> None:
    assert (site / "search" / "search_index.json").stat().st_size > 100_000
    for page, package in (("api", islands), ("client", islands_api)):
        text = (site / "reference" / page / "index.html").read_text("utf-8")
        missing = [name for name in package.__all__ if f'id="{package.__name__}.{name}"' not in text]
        assert not missing


@pytest.mark.parametrize("page", NAMES)
def test_a_generated_page_has_every_entry_of_its_tables(page: str, generated: dict[str, str]) -> None:
    text = generated[f"reference/{page}.md"]
    assert not [name for name in NAMES[page] if f"`{name}`" not in text]


def test_generated_pages_have_no_empty_rows(generated: dict[str, str]) -> None:
    """A row has something besides its name."""
    for path, text in generated.items():
        empty = re.findall(r"^\| [^|]+ \|[ |]*$", text, re.MULTILINE)
        assert not [row for row in empty if "---" not in row], path


def test_the_reference_has_the_estimator_of_scikit_learn(generated: dict[str, str]) -> None:
    assert "::: islands.sklearn.IslandsRegressor" in generated["reference/api.md"]


def test_the_navigation_has_every_generated_reference_page(generated: dict[str, str]) -> None:
    from support.pages import site_pages

    assert generated.keys() <= site_pages()
