"""Properties of expressions: text, canonical form and value."""

import math
import os
import pickle
import re
import subprocess
import sys
from copy import deepcopy
from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from islands.errors import ModelError
from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import ADD, MUL, PRIMITIVES, SIGN, SUB
from islands.expressions.printing import latex, plain
from islands.expressions.tree import Apply, Constant, Lagged, Shift, content, lags, remove_shifts, walk
from islands.models.regressor import canonical, regressor
from support.strategies import (
    any_number,
    expressions,
    grid,
    leaves,
    nearly,
    phi_factors,
    settled_value,
    signals,
)


def product(*factors):
    return Apply(MUL, factors)


@given(expressions(constants=any_number))
def test_text_of_an_expression_is_parsed_back(expression):
    assert parse(plain(expression)) == expression


@given(expressions(inputs=1))
def test_single_input_is_written_without_a_number(expression):
    assert "u1" not in plain(expression)
    assert parse(plain(expression)) == expression


@given(expressions(inputs=2))
def test_two_inputs_are_written_with_their_numbers(expression):
    text = plain(expression, inputs=2)
    assert "u(" not in text
    assert parse(text) == expression


@given(expressions())
def test_canonical_form_is_idempotent(expression):
    factor, core = canonical(expression)
    if factor:
        assert canonical(core) == (1.0, core)


@given(expressions())
def test_canonical_text_is_parsed_back_as_the_same_regressor(expression):
    _, item = regressor(expression)
    if item is not None:
        assert regressor(parse(plain(item.expression))) == (1.0, item)


@given(expressions(), signals())
def test_canonical_form_keeps_the_value(expression, signal):
    expected = settled_value(expression, signal)
    assume(expected is not None)
    factor, item = regressor(expression)
    found = 0.0 if item is None else settled_value(item.expression, signal)
    assume(found is not None)
    assert nearly(factor * found, expected)


@given(expressions())
def test_canonical_form_has_no_additional_lags(expression):
    _, core = canonical(expression)
    assert lags(core) <= lags(expression)


@given(expressions())
def test_canonical_form_has_no_back_shifts_and_no_synonyms(expression):
    rewritten = {"phi1", "phi2", "square", "cube"}
    for node in walk(canonical(expression)[1]):
        assert not isinstance(node, Shift)
        assert not (isinstance(node, Apply) and node.primitive.name in rewritten)


@given(st.lists(expressions(height=2), min_size=2, max_size=5), st.randoms(use_true_random=False))
def test_commuted_products_are_one_regressor(factors, rng):
    shuffled = rng.sample(factors, len(factors))
    (one, core), (other, same) = canonical(product(*factors)), canonical(product(*shuffled))
    assert core == same
    assert nearly(one, other)


@given(st.lists(leaves(), min_size=2, max_size=5), st.lists(grid, min_size=5, max_size=5), st.randoms())
def test_commuted_sums_are_one_regressor(signals_read, weights, rng):
    terms = [product(Constant(w), leaf) for w, leaf in zip(weights, signals_read, strict=False)]
    shuffled = rng.sample(terms, len(terms))
    assert canonical(Apply(ADD, tuple(terms))) == canonical(Apply(ADD, tuple(shuffled)))


@given(
    st.sampled_from([entry for entry in PRIMITIVES.values() if entry.commutative]),
    expressions(height=2),
    expressions(height=2),
)
def test_commuted_arguments_of_primitives_are_one_regressor(entry, first, second):
    assert canonical(Apply(entry, (first, second))) == canonical(Apply(entry, (second, first)))


@given(
    st.sampled_from([entry for entry in PRIMITIVES.values() if entry.parity or entry.degree is not None]),
    leaves(),
    grid.filter(bool),
)
def test_parity_and_degree_move_factors_out_of_functions(entry, leaf, number):
    if entry.degree is None:
        number = math.copysign(1.0, number)
    elif not entry.parity:
        number = abs(number)
    factor = 1.0 if number > 0.0 else float(entry.parity)
    found, core = canonical(Apply(entry, (product(Constant(number), leaf),)))
    assert core == Apply(entry, (leaf,))
    assert found == factor * abs(number) ** (entry.degree or 0.0)


@given(expressions(height=2), expressions(height=2), expressions(height=2))
def test_products_are_associative(a, b, c):
    assert canonical(product(a, product(b, c)))[1] == canonical(product(product(a, b), c))[1]


@given(expressions(height=2), st.sampled_from(["phi1", "phi2", "sub"]))
def test_phi_of_equal_arguments_is_zero(argument, name):
    assert regressor(Apply(PRIMITIVES[name], (argument, argument))) == (0.0, None)


@given(phi_factors())
def test_phi_is_antisymmetric(phi):
    exchanged = Apply(phi.primitive, phi.arguments[::-1])
    factor, core = canonical(phi)
    assert canonical(exchanged) == (-factor, core)


@given(expressions(), st.integers(1, 5), st.integers(1, 5))
def test_back_shifts_add(expression, first, second):
    assert remove_shifts(Shift(first, Shift(second, expression))) == remove_shifts(expression, first + second)


@given(expressions(height=2), st.integers(1, 5), signals())
def test_back_shift_delays_every_signal_under_it(expression, samples, signal):
    now = settled_value(expression, lambda channel, lag: signal(channel, lag + samples))
    assume(now is not None)
    assert value(Shift(samples, expression), signal) == now
    assert value(remove_shifts(Shift(samples, expression)), signal) == now


def test_two_back_shifts_of_five_give_lag_eleven():
    assert regressor(parse("q5(q5(u(k-1)))"))[1].expression == Lagged(1, 11)


@given(phi_factors(), st.integers(1, 9))
def test_odd_power_of_a_sign_is_the_sign_and_even_power_its_square(phi, power):
    sign = canonical(Apply(SIGN, (Apply(SUB, phi.arguments),)))[1]
    _, core = canonical(product(*[sign] * power)) if power > 1 else (1.0, sign)
    assert core == (sign if power % 2 else product(sign, sign))
    assert value(core, lambda *_: 1.0) == 0.0


@given(expressions(height=2), grid, grid)
def test_equal_terms_of_a_sum_merge(expression, first, second):
    terms = tuple(product(Constant(weight), expression) for weight in (first, second))
    factor, core = canonical(expression)
    # The weights within a sum are quotients, equal but for rounding.
    assume(not (isinstance(core, Apply) and core.primitive == ADD))
    expected = (first + second) * factor
    found, merged = canonical(Apply(ADD, terms))
    assert nearly(found, expected)
    assert merged == (core if expected else Constant(1.0))


@given(expressions(height=2), grid.filter(bool))
def test_constant_factor_belongs_to_the_parameter(expression, number):
    assume(canonical(expression)[0] != 0.0)
    factor, item = regressor(expression)
    found, same = regressor(product(Constant(number), expression))
    assert same == item
    assert nearly(found, number * factor)


@given(expressions(height=2), leaves().map(lambda leaf: Lagged(leaf.channel, 0)))
def test_regressor_with_lag_zero_raises_model_error(expression, present):
    assume(canonical(expression)[0] != 0.0)
    with pytest.raises(ModelError, match=rf"reads only past samples: channel {present.channel} has lag 0"):
        regressor(product(expression, present))


@given(st.lists(expressions(height=2), min_size=3, max_size=3))
def test_order_of_content_is_total(three):
    a, b, c = map(content, three)
    assert [a < b, a == b, a > b].count(True) == 1
    assert (a == b) == (three[0] == three[1])
    if a <= b <= c:
        assert a <= c


@given(leaves(), leaves())
def test_content_differs_between_functions_of_equal_arguments(first, second):
    for arity in (1, 2):
        functions = [entry for entry in PRIMITIVES.values() if entry.arity == arity]
        applied = [Apply(entry, (first, second)[:arity]) for entry in functions]
        assert len({content(expression) for expression in applied}) == len(applied)


@given(st.lists(expressions(height=2), min_size=2, max_size=8), st.randoms())
def test_sorting_by_content_does_not_depend_on_the_initial_order(found, rng):
    shuffled = rng.sample(found, len(found))
    assert sorted(found, key=content) == sorted(shuffled, key=content)


@given(expressions(constants=any_number))
def test_latex_has_balanced_braces_and_brackets(expression):
    depth = 0
    written = latex(expression, inputs=2)
    for mark in written:
        depth += {"{": 1, "}": -1}.get(mark, 0)
        assert depth >= 0
    assert depth == 0
    assert written.count(r"\left") == written.count(r"\right")


@given(expressions())
def test_latex_never_puts_an_exponent_on_an_exponent_or_a_fraction(expression):
    written = latex(expression)
    assert not re.search(r"\^\{[^{}]*\}\^", written)
    assert not re.search(r"\\frac\{[^{}]*(\{[^{}]*\}[^{}]*)*\}\{[^{}]*(\{[^{}]*\}[^{}]*)*\}\^", written)


DETERMINED = """
from islands.models.clusters import clusters
from islands.expressions.tree import (Lagged, content, lags)
from islands.models.narx import make_model
from islands.models.equations import equation, latex_equation
from islands.expressions.parsing import parse
from islands.expressions.printing import at_rest
terms = ["max(y(k-3), u2(k-1))*tanh(u1(k-2))", "u1(k-1)*sign(u1(k-1) - u1(k-4))^3", "y(k-1)", "3", "u2(k-7)",
         "exp(phi1(u1(k-1), u1(k-2)))*y(k-2)", "sin(y(k-1) + 2*u2(k-3) - u1(k-1)*u2(k-1))", "2*y(k-9)"]
model = make_model([(parse(text), 0.5) for text in terms], ("u1", "u2"))
print(equation(model)); print(latex_equation(model))
for found in clusters(model.regressors):
    print(at_rest(found.steady_state, 2), found.members, found.weights)
"""


def test_text_and_clusters_do_not_depend_on_the_seed_of_the_hash():
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", DETERMINED],
            env={**os.environ, "PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed in ("1", "2")
    ]
    one, other = (run.communicate()[0] for run in runs)
    assert one == other
    assert one.count("\n") == 7


# Hashes are kept within a process, and never leave it.


def copy_tree(expression):
    """Return an equal tree with new nodes."""
    match expression:
        case Shift(samples, argument):
            return Shift(samples, copy_tree(argument))
        case Apply(primitive, arguments):
            return Apply(replace(primitive), tuple(copy_tree(argument) for argument in arguments))
        case Constant(number):
            return Constant(number)
        case _:
            return Lagged(expression.channel, expression.lag)


@given(expressions(), expressions())
def test_equal_trees_have_equal_hashes(expression, other):
    same = copy_tree(expression)
    assert same is not expression
    assert same == expression
    assert hash(same) == hash(expression)
    assert len({expression, same, other}) == (1 if other == expression else 2)


@given(expressions())
def test_trees_that_differ_in_one_node_are_different_keys(expression):
    wider = Apply(PRIMITIVES["tanh"], (expression,))
    others = [Shift(1, expression), Shift(2, expression), wider, Apply(PRIMITIVES["sin"], (expression,))]
    assert len({expression, *others, *map(copy_tree, others)}) == 5


@given(expressions())
def test_copies_and_pickles_are_equal_and_found_under_the_same_key(expression):
    for copied in (pickle.loads(pickle.dumps(expression)), deepcopy(expression)):
        assert copied == expression
        assert hash(copied) == hash(expression)
        assert {expression: "found"}[copied] == "found"


CARRIED = """
import pickle, sys
from islands.expressions.tree import (walk)
from islands.expressions.parsing import parse
from islands.models.regressor import regressor
trees = [parse(text) for text in sys.argv[1:]]
regressors = [regressor(tree)[1] for tree in trees]
carried = sys.stdin.buffer.read()
if carried:
    others, other_regressors = pickle.loads(carried)
    assert others == trees and other_regressors == regressors
    found = dict.fromkeys(node for tree in trees for node in walk(tree))
    assert all(node in found for tree in others for node in walk(tree))
    assert [hash(tree) for tree in others] == [hash(tree) for tree in trees]
    assert {*others} == {*trees} and {*other_regressors} == {*regressors}
    assert {item.expression for item in other_regressors} == {item.expression for item in regressors}
sys.stderr.write(str(hash(trees[0])))
sys.stdout.buffer.write(pickle.dumps((trees, regressors)))
"""


def test_pickled_trees_equal_those_of_other_hash_seeds():
    texts = [
        "q5(q3(tanh(u(k-1)*y(k-2))))",
        "phi1(u(k-1), q4(u(k-1)))*y(k-1)^2",
        "2.5*y(k-1) - u2(k-3)",
        "y(k-7)",
    ]
    carried, seeds = b"", []
    for seed in ("1", "2", "1"):
        run = subprocess.run(
            [sys.executable, "-c", CARRIED, *texts],
            env={**os.environ, "PYTHONHASHSEED": seed},
            input=carried,
            capture_output=True,
            check=False,
        )
        assert run.returncode == 0, run.stderr.decode()
        carried = run.stdout
        seeds.append(run.stderr)
    # The test is meaningful only if the hashes of the processes differ.
    assert seeds[0] == seeds[2] != seeds[1]
