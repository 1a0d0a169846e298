"""Presets: the settings of the paper, parsed from its printed lists."""

from dataclasses import asdict

import pytest

from islands.evolution.presets import PRESETS, resolve_settings
from islands.evolution.settings import EFFORTS, Settings

#: Sections 6.1 and 6.2 and Appendix A, as printed (the fitness function's sentence is shortened).
CASE_1 = (
    "population size = 500; generations = 500; elitism = 10%; maximum GP height = 5; "
    "maximum MGGP terms = 10; CXPB = 0.8; MTPB = 0.2 (if not crossover); PRPB = 0.5; OLS tolerance = 1e-5; "
    "delay functions = q1, q2, q3, q4, q5; primitive functions = multiplication, subtraction, sign; "
    "simulation interval = 500"
)
CASE_2 = CASE_1.replace("1e-5", "1e-4").replace("interval = 500", "interval = 100")
APPENDIX = (
    "population size = 200; generations = 50; elitism = 10%; CXPB = 0.8; MTPB = 0.2 (if not crossover); "
    "OLS tolerance = 1e-3; delay functions = q1, q2, q3; primitive functions = multiplication; "
)
APPENDIX_S1 = APPENDIX + "maximum GP height = 3; maximum MGGP terms = 10"
APPENDIX_S2 = APPENDIX + "maximum GP height = 5; maximum MGGP terms = 30"

#: Names of the settings in the paper, and parsers of their values. Subtraction and sign are phi1 and phi2.
READ = {
    "population size": ("population", int),
    "generations": ("generations", int),
    "elitism": ("elite", lambda text: float(text.rstrip("%")) / 100),
    "maximum GP height": ("max_height", int),
    "maximum MGGP terms": ("max_terms", int),
    "CXPB": ("crossover", float),
    "MTPB": ("mutation", lambda text: float(text.split()[0])),
    "PRPB": ("prune", float),
    "OLS tolerance": ("tolerance", float),
    "delay functions": ("shifts", lambda text: tuple(int(name.strip(" q")) for name in text.split(","))),
    "primitive functions": (
        "primitives",
        lambda text: tuple(
            {"multiplication": "mul", "subtraction": "phi1", "sign": "phi2"}[name.strip()]
            for name in text.split(",")
        ),
    ),
    "simulation interval": ("shooting", int),
}


@pytest.mark.parametrize(
    ("preset", "printed"),
    [
        ("paper-case1", CASE_1),
        ("paper-case2", CASE_2),
        ("paper-appendix", APPENDIX_S1),
        ("paper-appendix-s2", APPENDIX_S2),
    ],
)
def test_paper_presets_have_the_printed_numbers(preset, printed):
    made = asdict(PRESETS[preset])
    entries = [entry.split("=") for entry in printed.split(";") if entry.strip()]
    assert len(entries) >= 10
    for name, text in entries:
        setting, read = READ[name.strip()]
        assert made[setting] == read(text.strip()), name


@pytest.mark.parametrize("preset", ["paper-case1", "paper-case2"])
def test_paper_cases_are_constrained_and_not_seeded(preset):
    made = PRESETS[preset]
    assert (made.structure, made.constraints, made.fitness) == ("phi", "hysteresis", "shooting")
    assert (made.library, made.from_library, made.refine) == ("", 0.0, False)


@pytest.mark.parametrize("preset", ["paper-appendix", "paper-appendix-s2"])
def test_paper_appendix_minimises_the_one_step_error_of_polynomials(preset):
    made = PRESETS[preset]
    assert (made.structure, made.constraints, made.fitness) == ("free", "none", "one-step")
    assert (made.library, made.from_library, made.refine) == ("", 0.0, False)


def test_paper_presets_differ_only_in_the_printed_settings():
    def difference(one, other):
        here, there = asdict(PRESETS[one]), asdict(PRESETS[other])
        return {name for name in here if here[name] != there[name]}

    assert difference("paper-case1", "paper-case2") == {"tolerance", "shooting"}
    assert difference("paper-case1", "paper-case1-islands") == {"islands", "topology"}
    assert difference("paper-appendix", "paper-appendix-s2") == {"max_height", "max_terms", "initial_terms"}


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_are_valid_settings(preset):
    assert Settings(**asdict(PRESETS[preset])) == PRESETS[preset]


@pytest.mark.parametrize("preset", PRESETS)
def test_presets_with_a_constraint_have_primitives_that_meet_it(preset):
    made = PRESETS[preset]
    if made.constraints == "hysteresis":
        assert made.structure != "free"
        assert {"phi1", "phi2"} <= set(made.primitives)
        assert not {"sub", "sign"} & set(made.primitives)


@pytest.mark.parametrize("preset", PRESETS)
def test_the_effort_sets_the_generations_that_are_not_given(preset):
    found = [resolve_settings(preset, {"effort": each}).generations for each in EFFORTS]
    assert found[0] == 0
    assert found == sorted(found)
    assert found[1] == PRESETS[preset].generations
    assert resolve_settings(preset, {"effort": "deep", "generations": 7}).generations == 7
