"""The paper's presets hold the paper's numbers: its own lists, read here once more."""

from dataclasses import asdict

import pytest

from islands.evolution.presets import PRESETS
from islands.evolution.settings import Settings
from islands.model.expression import Apply, height
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES

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

#: How the paper calls a setting, and how its words are read. Its subtraction and sign are phi1 and phi2.
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
def test_a_preset_of_the_paper_holds_exactly_its_numbers(preset, printed):
    made = asdict(PRESETS[preset])
    entries = [entry.split("=") for entry in printed.split(";") if entry.strip()]
    assert len(entries) >= 10
    for name, text in entries:
        setting, read = READ[name.strip()]
        assert made[setting] == read(text.strip()), name


@pytest.mark.parametrize("preset", ["paper-case1", "paper-case2"])
def test_the_paper_s_cases_are_constrained_and_seeded_by_nothing(preset):
    made = PRESETS[preset]
    assert (made.structure, made.constraints, made.fitness) == ("phi", "hysteresis", "shooting")
    assert (made.library, made.from_library, made.distinct, made.refine) == ("", 0.0, False, False)


@pytest.mark.parametrize("preset", ["paper-appendix", "paper-appendix-s2"])
def test_the_paper_s_appendix_minimises_the_prediction_error_of_free_polynomials(preset):
    made = PRESETS[preset]
    assert (made.structure, made.constraints, made.fitness) == ("free", "none", "one-step")
    assert (made.library, made.from_library, made.distinct, made.refine) == ("", 0.0, False, False)


def test_the_paper_s_cases_and_systems_differ_in_nothing_else():
    def difference(one, other):
        here, there = asdict(PRESETS[one]), asdict(PRESETS[other])
        return {name for name in here if here[name] != there[name]}

    assert difference("paper-case1", "paper-case2") == {"tolerance", "shooting"}
    assert difference("paper-appendix", "paper-appendix-s2") == {"max_height", "max_terms", "initial_terms"}


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_a_legal_setting_that_can_be_stored(preset):
    assert Settings(**asdict(PRESETS[preset])) == PRESETS[preset]


@pytest.mark.parametrize("preset", PRESETS)
def test_the_constraint_of_a_preset_can_be_met_by_what_may_stand_in_a_gene(preset):
    made = PRESETS[preset]
    if made.constraints == "hysteresis":
        assert made.structure != "free"
        assert {"phi1", "phi2"} <= set(made.primitives)
        assert not {"sub", "sign"} & set(made.primitives)


def test_there_are_the_paper_s_presets_and_ours():
    assert {"paper-case1", "paper-case2", "paper-appendix", "hysteresis", "narx"} <= set(PRESETS)


def test_a_preset_cannot_be_changed():
    with pytest.raises(TypeError):
        PRESETS["paper-case1"] = Settings()
    with pytest.raises(AttributeError):
        PRESETS["paper-case1"].population = 3


def test_phi_functions_are_single_nodes_of_two_arguments():
    """With that, and back-shifts counted, the paper's model (13) fits a height of 5 exactly."""
    assert PRIMITIVES["phi1"].arity == PRIMITIVES["phi2"].arity == 2
    gene = parse("phi2(q5(q5(q4(u(k-1)))), q5(q5(q1(u(k-1)))))")
    assert isinstance(gene, Apply)
    assert height(gene) == 4
