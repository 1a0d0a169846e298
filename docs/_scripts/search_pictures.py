"""Picture of a search in the README: errors of its islands.

``python docs/_scripts/search_pictures.py`` draws ``docs/pictures/search.svg`` again.
"""

from pathlib import Path

import islands
from islands.report.figures.convergence import draw_islands
from islands.report.figures.style import save
from islands.systems.example_records import EXAMPLE_RECORDS

PICTURE = Path(__file__).parents[1] / "pictures" / "search.svg"

ISLANDS = 8


if __name__ == "__main__":
    found = islands.identify(EXAMPLE_RECORDS["piezo"].make(), islands=ISLANDS)
    save(draw_islands(found.search_result), PICTURE)
