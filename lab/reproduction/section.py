"""Section of a reproduction: what one part of the paper says, and the same numbers computed here."""

from collections.abc import Callable
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from islands.errors import SettingsError
from lab.reproduction.tasks import Document

#: Last column of every comparison.
WHY = "why they differ"

#: Columns of a comparison with the paper.
COMPARED = ("quantity", "published", "here", WHY)


@dataclass(frozen=True, slots=True)
class ComparisonTable:
    """Table of published and computed numbers as text.

    Attributes
    ----------
    title : str
    rows : tuple of tuple of str
        One cell for each column. The last one is a sentence that the numbers of its row support.
    columns : tuple of str
        The last is `WHY`.

    Raises
    ------
    SettingsError
        A row has another number of cells than there are columns, or the last column is another one.
    """

    title: str
    rows: tuple[tuple[str, ...], ...]
    columns: tuple[str, ...] = COMPARED

    def __post_init__(self) -> None:
        if self.columns[-1] != WHY:
            raise SettingsError(f"the last column of {self.title!r} is {WHY!r}, got {self.columns[-1]!r}")
        for row in self.rows:
            if len(row) != len(self.columns):
                raise SettingsError(f"{self.title!r} has {len(self.columns)} columns, got the row {row}")


@dataclass(frozen=True, slots=True)
class SectionFigure:
    """Figure of a section.

    Attributes
    ----------
    name : str
        Unique name, which its files have: ``figure-5a``.
    caption : str
    draw : callable
        Draws the figure in a theme, an entry of `islands.report.figures.style.THEMES`.
    """

    name: str
    caption: str
    draw: Callable[[str], Figure]


@dataclass(frozen=True, slots=True)
class Section:
    """One part of the paper, reproduced.

    Attributes
    ----------
    title : str
    introduction : tuple of str
        Paragraphs: what is computed, on which data, with which settings.
    tables : tuple of ComparisonTable
    figures : tuple of SectionFigure
    document : dict
        The numbers as a JSON document.
    """

    title: str
    introduction: tuple[str, ...]
    tables: tuple[ComparisonTable, ...] = ()
    figures: tuple[SectionFigure, ...] = ()
    document: Document = field(default_factory=dict)
