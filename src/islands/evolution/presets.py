"""The table of presets: data, not code. `paper-*` are the paper's; `hysteresis` and `narx` are ours."""

from collections.abc import Mapping
from types import MappingProxyType

from islands.evolution.settings import Settings

_PAPER = Settings()

#: Section 6.1, theoretical piezo: shooting over 500 steps, tolerance 1e-5. Section 6.2: 100 steps, 1e-4.
#: Appendix A: one-step-ahead error, multiplication alone, no constraint; its second system allows more.
_APPENDIX = Settings(
    population=200,
    generations=50,
    tolerance=1e-3,
    max_height=3,
    shifts=(1, 2, 3),
    primitives=("mul",),
    structure="free",
    constraints="none",
    fitness="one-step",
)

PRESETS: Mapping[str, Settings] = MappingProxyType(
    {
        "paper-case1": _PAPER,
        "paper-case2": Settings(tolerance=1e-4, shooting=100),
        "paper-appendix": _APPENDIX,
        "paper-appendix-s2": Settings(
            population=200,
            generations=50,
            tolerance=1e-3,
            max_height=5,
            max_terms=30,
            initial_terms=(1, 30),
            shifts=(1, 2, 3),
            primitives=("mul",),
            structure="free",
            constraints="none",
            fitness="one-step",
        ),
        "hysteresis": Settings(
            population=300,
            generations=80,
            shooting=1000,
            elite=0.2,
            crossover=0.4,
            mutation=1.0,
            prune=0.1,
            tolerance=1e-9,
            max_terms=9,
            initial_terms=(2, 9),
            structure="increment",
            outer=0.7,
            library="phi-polynomial",
            from_library=0.6,
            distinct=True,
            refine=True,
        ),
        "narx": Settings(
            population=200,
            generations=60,
            elite=0.2,
            crossover=0.4,
            mutation=1.0,
            prune=0.1,
            tolerance=1e-9,
            max_terms=15,
            initial_terms=(2, 15),
            shifts=(1, 2, 3),
            primitives=("mul",),
            structure="free",
            constraints="none",
            max_height=4,
            shooting=100,
            outer=0.7,
            library="polynomial",
            library_degree=3,
            from_library=0.6,
            distinct=True,
            refine=True,
        ),
    }
)
