"""Sentences: each statement is complete, and one that fails loses no other one."""

import re
from importlib.resources import files
from itertools import product
from types import SimpleNamespace

import pytest

from islands.records.inspection.column_roles import ColumnChoice
from islands.records.inspection.fact import Fact
from islands.sentences import write, write_one
from support.statements import check_template

TEMPLATES = [path for path in (files("islands") / "templates").iterdir() if path.name.endswith(".txt")]


def fact(value=3.0, unit="V", interval=(2.0, 4.0), confidence=0.9, **details):
    known = Fact("property", "u", "samples", value, unit, interval, confidence)
    names = {"samples": 50, "dt": 0.1, "seconds": 5.0, "missing": 0, "part": None, "output": "y", "levels": 3}
    names |= {"ends": ("0 V", "1 V"), "level": 0.01, "percent": 0.5, "step": 0.1, "inputs": ("u",)}
    return {"fact": known, "name": "u", **names, **details}


def choice(**details):
    names = {"signal": "", "least": 80, "inputs": ("u",), "output": "y", "share": None, "labels": ()}
    names |= {
        "is_named": False,
        "is_invisible": False,
        "also": [],
        "together": [],
        "copies": (),
        "products": (),
    }
    return {"choice": ColumnChoice(("u",), "y", 0.9, "choice_given"), "compared": None, **names, **details}


RESTS = [fact(inputs=inputs, motion=(0.1, rate)) for inputs in (("u",), ("u", "v")) for rate in (0.0, 0.02)]

LINEAR = [
    {
        "order": 2,
        "error": 0.3,
        "output_unit": "V",
        "share": 0.02,
        "dead_times": late,
        "signal": "u",
        "depends_on_amplitude": each,
        "is_certain": each,
        "probability": 1e-6,
    }
    for late, each in product(([], [("u", 0.3), ("v", 2.0)]), (True, False))
]

#: Facts with which each statement about a record is written.
RECORD = {
    "not_computed": [fact(reason="the record is empty")],
    "samples": [fact(), fact(missing=3, part=(500, 900))],
    **{f"quantisation_{each}": [fact()] for each in ("two_levels", "none", "held", "steps")},
    **{f"saturation_{each}": [fact()] for each in ("switched", "held", "none")},
    "saturation_flat": [fact(0.1, places=(("maximum", 2.0), ("minimum", 0.0)), signal_unit="V")],
    **{f"noise_{each}": [fact()] for each in ("below_step", "invisible", "bound", "white")},
    "band": [fact(nyquist=5.0)],
    "levels_many": [fact()],
    "levels_few": [fact(is_binary=each) for each in (True, False)],
    "coverage": [fact(0.8)],
    "excitation_short": [fact()],
    "excitation_order": [
        fact(order=order, is_bound=bound) for order, bound in product((1, 50), (True, False))
    ],
    **{f"dead_time_{each}": [fact()] for each in ("short", "silent", "uncertain")},
    "dead_time_known": [
        fact(value, is_interval=wide, is_certain=certain)
        for value, wide, certain in product((0.0, 1.0, 3.0), (True, False), (True, False))
    ],
    **{f"rest_{each}": RESTS for each in ("unknown", "rests", "moves")},
    "loop_no_cycles": [fact(longest=each) for each in (None, 300)],
    **{f"loop_{each}": [fact()] for each in ("not_judged", "two_levels", "none", "undecided")},
    **{f"loop_{each}": [fact()] for each in ("hysteresis", "dynamics")},
    **{f"drift_{each}": [fact()] for each in ("short", "missing", "none", "visible")},
    "rate_oversampled": [fact(is_noisy=each) for each in (True, False)],
    **{f"rate_{each}": [fact()] for each in ("unconnected", "low", "suitable")},
    "linear_constant": [fact()],
    "feedback_unknown": [fact()],
    "feedback_none": [fact()],
    "feedback_visible": [fact(inputs=("u",)), fact(inputs=("u", "v"))],
    "feedback_unstable": [fact(inputs=names, pole=1.02, seconds=0.3) for names in (("u",), ("u", "v"))],
    **{f"linear_{each}": [fact(**values) for values in LINEAR] for each in ("within", "disturbed", "not")},
    **{
        f"choice_{each}": [choice()]
        for each in ("given", "too_short", "no_input", "no_output", "no_response")
    },
    "choice_too_few": [choice(signal=each) for each in ("", "u")],
    "choice_found": [
        choice(is_named=True, share=0.5, also=["a"], together=["b", "c"]),
        choice(is_invisible=True, also=["a", "b"], together=["c"]),
    ],
    "remark_labels": [choice(labels=(("step", "u"), ("test", "y")))],
    "remark_copies": [choice(copies=(("b", "a scaled copy", "u"),))],
    "remark_products": [choice(products=(("power", "u", "y"),))],
    "remark_compared": [choice(compared=(20, 12))],
    "text_sampling": [
        {"sampling": SimpleNamespace(dt=None, samples=50), "varies": False, "breaks": []},
        {
            "sampling": SimpleNamespace(dt=0.1, samples=50, time="t", jitter=0.01),
            "varies": True,
            "breaks": [("gaps", ("line 3", "line 7"), 4), ("backward", ("line 9",), 0)],
        },
    ],
    "text_choice": [choice()],
}

ALARM = SimpleNamespace(
    cause="k", before=2.0, after=1.5, strength=[("f", 0.1, "N"), ("d", 1.0, "")], equivalents=["a"]
)
RECORDED = SimpleNamespace(name="7.csv", states=SimpleNamespace(noise=0.01), statistic=3.0)


def alarm(kind, **changes):
    names = {"alarm": ALARM, "is_ramp": False, "is_growing": True, "unit": "N/m", "since": "3.csv"}
    return {"kind": kind, **names, "earliest": "2.csv", "latest": "5.csv", **changes}


ALARMS = [
    alarm(kind, is_ramp=ramp, latest=latest)
    for kind, ramp, latest in product(
        ("PARAMETER", "EFFECT", "NOISE", "UNKNOWN"), (True, False), ("2.csv", "5.csv")
    )
]
MONITOR = {
    "last_record": [
        {"record": record, "values": [("k", 2.0, 0.1, "N/m")], "threshold": 9.0, "seen": 3, "training": 8}
        for record in (RECORDED, SimpleNamespace(**{**vars(RECORDED), "statistic": None}))
    ],
    "change": ALARMS,
    "alarm": ALARMS,
}

SEPARATION = {"distance": 2.0, "required_distance": 4.2}
PAIR = {"labels": ["delay (`delay`)", "jump"], "recorded": SEPARATION, "repeats": 3, "is_repeated": True}
INPUT = {"description": "steps", "samples": 500, "dt": 0.01, "is_within_record": True}
EXCEEDING = INPUT | {"is_within_record": False}
NOISE = SimpleNamespace(std=0.1, is_white=True, origin=SimpleNamespace(name="GIVEN"))


def plan(**changes):
    record = SimpleNamespace(input_names=("u",), samples=500, dt=0.01, output_unit="um")
    isolability = SimpleNamespace(groups=[("a", "b"), ("c", "d")], undetectable=("e", "f"))
    required = SimpleNamespace(separation=SimpleNamespace(required=4.2))
    decisive = SimpleNamespace(description="steps", u=SimpleNamespace(size=500), dt=0.01)
    names = {"simulation": "linear:1", "record": record, "noise": NOISE, "isolability": isolability}
    names |= {"pair": ("a", "b"), "alternatives": [required], "left_out": (), "decisive": decisive, **changes}
    return {"plan": SimpleNamespace(**names), "reference": 1.0, "unit": "sigma"}


PLAN = {
    "head_record": [plan()],
    "head_noise": [
        plan(),
        plan(
            noise=SimpleNamespace(
                std=0.1,
                is_white=False,
                model=SimpleNamespace(order=3),
                time_constant=20.0,
                origin=SimpleNamespace(name="RESIDUAL"),
            )
        ),
    ],
    **{each: [plan()] for each in ("legend", "strengths", "groups_inseparable", "groups_undetectable")},
    **{each: [plan()] for each in ("alternatives", "insufficient", "decisive_input", "decisive_separation")},
    "alternative": [
        {"each": SimpleNamespace(change="twice the amplitude", duration=5.0, rate=2.0), "input_unit": unit}
        for unit in ("V", "")
    ],
    "end_left_out": [plan(left_out=("a", "b"))],
    "end_sufficient": [plan(decisive=None)],
    "advice": [
        {"input": designed, "pairs": [PAIR | {"predicted": SEPARATION}, PAIR | pair], "excesses": excesses}
        for designed, excesses in (
            ({}, []),
            (INPUT, []),
            (INPUT | {"is_within_record": False}, [("rate", 2.5)]),
        )
        for pair in ({"recorded": None}, {"predicted": None}, {"predicted": SEPARATION, "is_repeated": False})
    ],
}


LEVEL = SimpleNamespace(name="h", lower=0.0, unit="m")
EXTENSION = {
    "offset": [{"title": "offset of the input", "input": "q", "state": LEVEL, "loss": 0.01}],
    "output": [{"end": -0.3, "limit": 0.0, "unit": unit, "state": LEVEL} for unit in ("m", "")],
}


@pytest.mark.parametrize(
    ("template", "cases"),
    [("record", RECORD), ("monitor", MONITOR), ("plan", PLAN), ("extension", EXTENSION)],
)
def test_each_statement_is_complete(template, cases):
    check_template(template, cases)


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: path.name)
def test_a_template_has_no_limit(path):
    """A comparison of numbers is a decision, which belongs to the facts."""
    code = " ".join(re.findall(r"{[{%](.*?)[}%]}", path.read_text(), flags=re.DOTALL))
    assert not re.search(r"[<>]|[!=]= *[\d.]", re.sub(r'"[^"]*"', "", code))


def test_a_statement_that_fails_says_so_and_leaves_the_others():
    shared, failed = write("comparison", "lead", is_comparable=True, refitted=["A"])
    assert shared == "All models were validated on the same samples."
    assert failed.startswith("(not computed: refits: UndefinedError: 'refit_note' is undefined")


def test_a_statement_that_does_not_hold_is_not_written():
    assert not write_one("comparison", "lead_refits", refitted=[])
