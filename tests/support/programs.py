"""Models and records on which exported programs must equal the kernels."""

import numpy as np

import islands
from islands.expressions.primitives import PRIMITIVES
from islands.records.dataset import Dataset
from islands.systems.published_models import PUBLISHED

SAMPLES = 60

#: Primitives whose last bits depend on the mathematical library of the machine.
OF_THE_LIBRARY = {"exp", "log", "sin", "cos", "tanh"}

#: Column names that would end a comment, a string or a line, or cannot be encoded.
HOSTILE_NAMES = [
    'u"""',
    "u\\Nm",
    'u"',
    "u\n",
    "u\r\nint x;",
    "u\\",
    "u\\\n",
    "µ_µm",
    '"""\nraise SystemExit\n"""',
    "*/ int broken = ; /*",
    "*\\\n/ broken",
    "/* u",
    "u ??/",
    "\n%}\nbroken = ;",
    "...\n%{\n",
    "\u202eu\u2028",
    "\0",
    "\ud800",
]


def record(inputs=1, seed=0, dt=0.1):
    rng = np.random.default_rng(seed)
    return Dataset(rng.normal(size=(SAMPLES, inputs)), rng.normal(size=SAMPLES), dt)


def model(terms, names=("u",), primitives=PRIMITIVES):
    return islands.make_model(
        [(islands.parse(text, primitives), value) for text, value in terms.items()], names
    )


def with_primitive(name):
    arguments = "u(k-1), y(k-2)" if PRIMITIVES[name].arity == 2 else "u(k-1) - 0.3*y(k-2)"
    return model({"y(k-1)": 0.3, f"{name}({arguments})*u(k-3)": 0.01, "1": 0.1})


CASES = {
    **{name: with_primitive(name) for name in PRIMITIVES},
    **{f"published {name}": entry.model for name, entry in PUBLISHED.items()},
    "many parts": model(
        {
            "y(k-1)*y(k-2)*u(k-1)*u(k-2)*u(k-3)*max(y(k-3), 0.5)*0.1*u(k-4)": 0.07,
            "(u(k-1) + 0.1*u(k-2) - 0.7*u(k-3) + 1e-3)*(y(k-1) - 0.3)^3": 0.011,
            "u(k-1)^9": 1e-4,
            "-2.5": 0.3,
            "y(k-5)": 0.1,
        }
    ),
    "several inputs": model(
        {"y(k-1)": 0.5, "u1(k-1)": 0.1, "u3(k-2)*u2(k-1)": 0.2, "max(u2(k-1), -0.25)": 0.3},
        ("a_V", "b_A", "c_K"),
    ),
    "a constant, that needs no past": model({"1": 0.75}),
    "digits down to the last": model({"y(k-1)": 0.1 + 0.2, "u(k-1)": 1 / 3, "1": 1e-300}),
    "no output": model({"u2(k-3)": 0.5}, ("one", "other")),
}


#: Smallest argument whose quotients with the others are finite.
_SMALLEST = 1e-300

#: Arguments at which primitives jump, are protected or clipped, and their neighbours.
_EDGES = [0.0, -0.0, 1.0, -1.0, _SMALLEST, -_SMALLEST, 1e-9, -1e-9, 49.9, 50.1, 700.0, -700.0]


def at_the_edges(name):
    """Return a model of one primitive, and a record with every pair of edge values."""
    pairs = np.array([(a, b) for a in _EDGES for b in _EDGES])
    u = np.vstack([pairs, [0.0, 0.0]])
    arguments = "u1(k-1), u2(k-1)" if PRIMITIVES[name].arity == 2 else "u1(k-1)"
    return model({f"{name}({arguments})": 1.0}, ("a", "b")), Dataset(u, np.zeros(len(u)), 0.1)


def record_of(name):
    """Return the record of a case."""
    return record(CASES[name].inputs, dt=CASES[name].dt or 0.1)


def bits(numbers):
    """Return the bits of numbers; they distinguish zero from minus zero."""
    return np.asarray(numbers, np.float64).view(np.int64).tolist()
