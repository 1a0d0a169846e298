"""Findings of a diagnosis: the causes that a record cannot distinguish from a named one."""

from islands.diagnosis.inference.confidence import ScoredAlternative
from islands.diagnosis.inference.finding import list_equivalents

NAMED = ScoredAlternative(100.0, None)


def test_equivalents_of_equal_score_have_one_order() -> None:
    """Different processes iterate over a set of strings in different orders."""
    causes = [f"cause-{number}" for number in (3, 7, 1, 8, 5, 2, 6, 4)]
    scored = {cause: ScoredAlternative(99.0, None) for cause in causes} | {
        "best": ScoredAlternative(99.5, None)
    }
    assert list_equivalents(scored, NAMED, ()) == ("best", *sorted(causes))


def test_free_form_is_equivalent_only_if_it_is_better() -> None:
    scored = {name: ScoredAlternative(99.5, None) for name in ("stiction", "free-force")}
    assert list_equivalents(scored, NAMED, ("free-force",)) == ("stiction",)
    scored["free-force"] = ScoredAlternative(100.5, None)
    assert list_equivalents(scored, NAMED, ("free-force",)) == ("free-force", "stiction")
