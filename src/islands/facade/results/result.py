"""Result of `fit` and `identify`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from islands.evolution.progress import Steps
from islands.evolution.search_result import SearchResult
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.notebook_html import render_html
from islands.facade.results.ranked_models import RankedModels, write_validation_key
from islands.io.result_folder import content_sha256, write_result
from islands.io.result_text.model_description import describe
from islands.io.result_text.summary_text import summary
from islands.validation.recommendation import Recommendation

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Result(RankedModels[FittedModel]):
    """Result of a search."""

    search_result: SearchResult

    @property
    def models(self) -> tuple[FittedModel, ...]:
        """All models, in the order of their free-run error on the validation data."""
        return tuple(
            FittedModel(rank, entry, self.search_result)
            for rank, entry in enumerate(self.search_result.models, start=1)
        )

    @property
    def recommendation(self) -> Recommendation:
        """Rank of the recommended model, and the reasons for the choice."""
        return self.search_result.recommendation

    @property
    def left_out(self) -> tuple[str, ...]:
        """Steps that a request to stop has left out; empty for a complete result."""
        return self.search_result.search.left_out

    def with_wall_time(self, seconds: float) -> "Result":
        """Return a copy of the result with the duration of the search in seconds."""
        return Result(replace(self.search_result, search=replace(self.search_result.search, wall_s=seconds)))

    def save(self, folder: str | Path, steps: Steps | None = None) -> Path:
        """Write ``result.json``, the models, the figures of the recommended model, and the texts.

        The figures are optional ``steps``, which a stop request leaves out.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._draw_figures(folder / "figures", steps or Steps())
        write_result(self.search_result, folder)
        return folder

    def _draw_figures(self, figures: Path, steps: Steps) -> None:
        if steps.skip("figures"):  # before matplotlib is loaded, which takes a second
            for path in figures.glob("*.svg"):
                path.unlink()  # of an earlier result
            return
        from islands.figures.model_responses import RESPONSES, draw_responses  # noqa: PLC0415
        from islands.figures.registry import SEARCH_FIGURES, model_figures, search_figures  # noqa: PLC0415
        from islands.figures.style import save  # noqa: PLC0415

        figures.mkdir(parents=True, exist_ok=True)
        # An earlier result in the folder may have had a loop or an equilibrium.
        for name in ("loop", *RESPONSES):
            (figures / f"{name}.svg").unlink(missing_ok=True)
        drawn: dict[str, Callable[[], Figure]] = {
            kind: partial(self.best.plot, kind) for kind in model_figures(self.search_result)
        }
        for name in search_figures(self.search_result):
            drawn[name] = partial(SEARCH_FIGURES[name], self.search_result)
        for name, draw in drawn.items():
            if steps.skip(f"figure {name}"):
                (figures / f"{name}.svg").unlink(missing_ok=True)
            else:
                save(draw(), figures / f"{name}.svg")
        if not steps.skip("figures of responses"):
            for name, figure in draw_responses(self.best.model, self.search_result.split.estimation).items():
                save(figure, figures / f"{name}.svg")

    def __str__(self) -> str:
        return summary(self.search_result)

    @property
    def validation_key(self) -> str:
        """Text that identifies the validation data."""
        found = self.search_result
        return write_validation_key(
            found.record.sha256 or content_sha256(found.record), found.settings, found.average
        )

    def _repr_html_(self) -> str:
        # The equation, which is indented, is shown in MathML.
        sentences = [line for line in describe(self.search_result) if not line.startswith(" ")]
        return render_html(self.best.model, sentences, self.best.plot())
