"""The row function of a primitive equals its Python function on every lane."""

import ctypes
import decimal
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from islands import program
from islands.errors import ModelError, RecordError, SettingsError
from islands.expressions.evaluation import value
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Apply, Constant, Lagged
from islands.expressions.user_primitive import primitive
from islands.kernels import codegen
from islands.kernels.codegen import CONSTANT, LAGGED
from islands.kernels.interpreter import (
    ADD,
    CALL,
    MAX_FACTORS,
    MULTIPLY,
    SIGN,
    SIGN_OF_DIFFERENCE,
    SIGN_OF_PRODUCT,
    SUBTRACT,
    TEMPORARY,
)
from islands.kernels.summation import CHUNK, dot
from islands.models.regressor import regressor
from islands.program import TermPool, gram_matrix, link, regressor_matrix, row_address, select_rows
from islands.records.dataset import Dataset
from support.oracles import NUMBERS, side_by_side
from support.strategies import INPUTS, nearly, records, regressors, settled_value, signals

ROW = ctypes.POINTER(ctypes.c_double)
PROBES = [0.0, 1.0, -1.0, 0.3, -0.7, 2.5, -41.0, 60.0, 1e3, 1e-10, -1e-12]

several = st.lists(regressors(), min_size=1, max_size=5)


def run(entry, *arguments):
    """Call the machine address on whole rows; return the target row, which has one additional lane."""
    function = ctypes.CFUNCTYPE(None, ROW, ROW, ROW, ctypes.c_int64)(row_address(entry))
    rows = [np.array(values) for values in (arguments[0], arguments[-1])]
    target = np.full(len(rows[0]) + 1, 99.0)
    function(*(row.ctypes.data_as(ROW) for row in (target, *rows)), len(rows[0]))
    return target


def expected(entry, *arguments):
    return [entry.scalar(*values) for values in zip(*arguments, strict=True)]


@pytest.mark.ci
@pytest.mark.parametrize("entry", PRIMITIVES.values(), ids=list(PRIMITIVES))
def test_row_function_equals_its_scalar_function_on_every_lane(entry):
    pairs = [PROBES] if entry.arity == 1 else zip(*[(a, b) for a in PROBES for b in PROBES], strict=True)
    arguments = [list(values) for values in pairs]
    found = run(entry, *arguments)
    np.testing.assert_allclose(found[:-1], expected(entry, *arguments), rtol=4e-16, atol=0.0)
    assert found[-1] == 99.0


def test_user_defined_function_runs_through_its_address():
    def dead_zone(a, b):
        width = abs(b)
        return math.copysign(abs(a) - width, a) if abs(a) > width else 0.0

    entry = primitive("dead_zone", dead_zone)
    first, second = [3.0, -3.0, 0.5, -7.0], [1.0, 1.0, 1.0, -2.5]
    assert run(entry, first, second)[:-1].tolist() == [2.0, -2.0, 0.0, -4.5]
    assert expected(entry, first, second) == [2.0, -2.0, 0.0, -4.5]


def test_user_defined_math_function_runs_through_its_address():
    entry = primitive("arc", math.atan, parity=-1)
    np.testing.assert_allclose(run(entry, PROBES)[:-1], expected(entry, PROBES), rtol=4e-16)


def test_user_defined_function_may_return_integers():
    entry = primitive("step", lambda a: 1 if a > 0 else 0)
    assert run(entry, [2.0, -2.0])[:-1].tolist() == [1.0, 0.0]


def test_division_by_zero_gives_nan_without_a_crash():
    entry = primitive("pole", lambda a: (a - 0.125) / (a - 0.125))
    assert np.isnan(run(entry, [0.125, 3.0])[0])


@pytest.mark.ci
def test_uncompilable_function_is_refused():
    entry = primitive("slow", lambda a: float(decimal.Decimal(a)))
    with pytest.raises(
        ModelError, match="primitive 'slow' does not compile; use arithmetic, comparisons and math"
    ):
        row_address(entry)


def test_functions_are_compiled_once_and_identified_by_object():
    entry = primitive("twice", lambda a: 2.0 * a)
    assert row_address(entry) == row_address(replace(entry, latex="2 {0}"))
    other = primitive("twice", lambda a: a + a + 1.0)
    assert row_address(other) != row_address(entry)
    assert run(other, [1.0])[0] == 3.0


def test_row_function_of_a_built_in_primitive_is_loaded_from_the_cache():
    row_address(PRIMITIVES["sqrt"])
    again = program._compile.__wrapped__(PRIMITIVES["sqrt"].scalar, 1, "sqrt")
    assert again.cache_hits == 1


def test_row_function_of_a_user_is_compiled_in_every_process():
    def half(a):
        return a / 2.0

    entry = primitive("half", half)
    row_address(entry)
    assert program._compile.__wrapped__(entry.scalar, 1, "half").cache_hits == 0


def made(text, table=PRIMITIVES):
    return regressor(parse(text, table))[1]


def used_nodes(pool):
    """Return the nodes of the pool as tuples, without unused ones."""
    nodes = pool.nodes
    count = len(pool._indices)
    columns = (nodes.operation, nodes.first, nodes.second, nodes.address, nodes.value)
    return list(zip(*(column[:count].tolist() for column in columns), strict=True))


def node_values(pool, signal):
    """Evaluate every node on single values."""
    called = {row_address(entry): entry for entry in PRIMITIVES.values()}
    found = []
    for operation, first, second, address, number in used_nodes(pool):
        if operation == LAGGED:
            found.append(signal(first, second))
        elif operation == CONSTANT:
            found.append(number)
        elif operation == CALL:
            found.append(called[address].scalar(*(found[first], found[second])[: called[address].arity]))
        else:
            operands = (found[first],) if operation == SIGN else (found[first], found[second])
            found.append(NUMBERS[operation](*operands))
    return found


@pytest.mark.ci
@given(several, signals())
def test_factors_of_a_term_multiply_to_the_value_of_the_expression(terms, signal):
    try:
        expected = [value(item.expression, signal) for item in terms]
    except ValueError:  # the sine of an infinite value
        assume(False)
    pool = TermPool()
    indices = pool.terms(terms)
    nodes = node_values(pool, signal)
    for number, wanted in zip(indices, expected, strict=True):
        degree = pool.nodes.degree[number]
        assert 1 <= degree <= MAX_FACTORS
        found = math.prod(nodes[factor] for factor in pool.nodes.factors[number, :degree])
        np.testing.assert_array_equal(found, wanted)


@given(several)
def test_equal_expressions_share_a_node_and_operands_precede_readers(terms):
    pool = TermPool()
    pool.terms(terms)
    nodes = used_nodes(pool)
    assert len(set(nodes)) == len(nodes)
    for number, (operation, first, second, *_) in enumerate(nodes):
        if operation >= 0:
            assert max(first, second) < number


@given(several, several)
def test_known_terms_keep_their_index_and_add_no_node(terms, others):
    pool = TermPool()
    indices = pool.terms(terms).tolist()
    pool.terms(others)
    size, nodes = len(pool), len(used_nodes(pool))
    assert pool.terms(terms).tolist() == indices
    assert (len(pool), len(used_nodes(pool))) == (size, nodes)
    texts = [item.text for item in terms]
    assert len(set(indices)) == len(set(texts))
    assert size == len({item.text for item in (*terms, *others)})


@pytest.mark.ci
@given(several, several)
def test_program_does_not_depend_on_other_terms_of_the_pool(terms, others):
    """The nodes have other indices, the program is the same."""
    pool = TermPool()
    pool.terms(others)
    indices = pool.terms(terms)
    operand_index = np.full(pool.nodes.operation.size, -1, np.int64)
    for found, expected in zip(
        codegen.generate_program(pool.nodes, indices, operand_index), link(terms), strict=True
    ):
        np.testing.assert_array_equal(found, expected)
    assert (operand_index == -1).all()


@pytest.mark.ci
def test_pool_grows_and_keeps_its_terms():
    pool = TermPool()
    texts = [f"exp({factor}*u(k-{lag})) + y(k-1)" for factor in range(2, 30) for lag in range(1, 40)]
    indices = pool.terms([made(text) for text in texts]).tolist()
    assert indices == list(range(len(texts)))
    assert len(pool) == len(texts) > 1024
    assert len(used_nodes(pool)) > 4 * 256
    values = node_values(pool, lambda channel, lag: 1.0 / lag if channel else 2.0)
    for number, text in ((0, texts[0]), (500, texts[500]), (len(texts) - 1, texts[-1])):
        expected = value(made(text).expression, lambda channel, lag: 1.0 / lag if channel else 2.0)
        assert values[pool.nodes.factors[number, 0]] == expected


def test_deep_expression_and_many_nodes_give_a_program():
    """The expression is deeper than the initial stack, and has more nodes than the initial array."""
    text = "u(k-1)"
    for lag in range(1, 60):
        text = f"tanh({text} - y(k-{lag}))"
    assert len(link([made(text)]).code) == 2 * 59
    wide = link([made(" + ".join(f"abs(u(k-{lag}) - 1)" for lag in range(1, 200)))])
    assert len(wide.code) == 199 + 199 + 198


def test_expression_and_its_regressor_have_the_same_index():
    pool, item = TermPool(), made("y(k-1)*exp(u(k-1))")
    assert pool.term(item) == pool.term(item.expression) == 0
    assert pool.term(Lagged(0, 0)) == 1
    assert pool.term(Constant(2.5)) == 2
    assert pool.terms([]).shape == (0,)


def test_functions_with_one_name_in_two_pools_keep_their_addresses():
    one, other = primitive("own", lambda a: a + 1.0), primitive("own", lambda a: a + 2.0)
    found = [
        link([made("own(u(k-1))", {**PRIMITIVES, "own": entry})]).addresses.tolist() for entry in (one, other)
    ]
    assert found == [[row_address(one)], [row_address(other)]]
    assert found[0] != found[1]


@given(several, several)
def test_program_does_not_depend_on_earlier_programs(terms, others):
    """Programs share a pool of recent terms, which has other indices than a new pool."""
    link(others)
    pool = TermPool()
    indices = pool.terms(terms)
    expected = codegen.generate_program(pool.nodes, indices, np.full(pool.nodes.operation.size, -1, np.int64))
    for again in (link(terms), link(terms)):
        for found, column in zip(again, expected, strict=True):
            np.testing.assert_array_equal(found, column)


def test_function_with_the_name_of_a_built_in_one_keeps_its_address():
    item, own = made("tanh(u(k-1))"), replace(primitive("mine", lambda a: a + 1.0), name="tanh")
    link([item])
    assert link([Apply(own, (Lagged(1, 1),))]).addresses.tolist() == [row_address(own)]
    assert link([item]).addresses.tolist() == [row_address(PRIMITIVES["tanh"])]


def test_zeros_of_both_signs_keep_their_sign():
    for zero in (0.0, -0.0, 0.0):
        (found,) = link([Apply(PRIMITIVES["max"], (Lagged(1, 1), Constant(zero)))]).constants
        assert math.copysign(1.0, found) == math.copysign(1.0, zero)


def test_pool_of_recent_terms_is_bounded():
    for lag in range(1, 3 * program._MOST_NODES):
        link([Lagged(1, lag)])
    assert len(program._RECENT.pool) <= program._MOST_NODES + 1
    assert program._RECENT.pool.nodes.operation.size <= 2 * program._MOST_NODES


def of(text, table=PRIMITIVES):
    return regressor(parse(text, table))[1]


def ramp(segments):
    """Return a record with the sample index as output and a hundred times the index as input."""
    numbers = np.arange(sum(segments), dtype=float)
    return Dataset(100.0 * numbers, numbers, 0.1, segments=segments)


def noise(samples, segments=(), inputs=1):
    rng = np.random.default_rng(7)
    return Dataset(rng.normal(size=(samples, inputs)), rng.normal(size=samples), 0.1, segments=segments)


@given(records(longest=30), st.lists(regressors(), min_size=1, max_size=3))
def test_regressor_matrix_has_the_value_of_each_term_on_every_row(record, terms):
    warm_up = max(item.maximum_lag for item in terms)
    spans = [(begin + warm_up, end) for begin, end in record.bounds]
    samples = [sample for first, end in spans for sample in range(first, end)]
    assume(samples)
    channels = np.vstack([record.y, record.u.T])
    found = regressor_matrix(terms, record, warm_up)
    assert found.shape == (len(terms), len(samples))
    for item, column in zip(terms, found.tolist(), strict=True):
        for sample, number in zip(samples, column, strict=True):
            expected = settled_value(
                item.expression,
                lambda channel, lag, at=sample: float(channels[channel, at - lag]),
                perturbations=2,
            )
            assert expected is None or nearly(number, expected)


def test_rows_start_after_the_warm_up_of_every_segment():
    found = regressor_matrix([of("u(k-2)"), of("y(k-1)"), Lagged(0, 0)], ramp((5, 4)), 3)
    assert found.tolist() == [[100.0, 200.0, 600.0], [2.0, 3.0, 7.0], [3.0, 4.0, 8.0]]


def test_segments_no_longer_than_the_warm_up_have_no_rows():
    assert regressor_matrix([Lagged(0, 0)], ramp((3, 5, 2, 4)), 3).tolist() == [[6.0, 7.0, 13.0]]


def test_row_reads_nothing_of_another_segment():
    record = noise(60, (20, 40))
    terms = [of("y(k-1)*u(k-3)"), of("exp(u(k-5))")]
    spoiled = Dataset(
        np.vstack([record.u[:20] + 7.0, record.u[20:]]),
        np.append(record.y[:20] - 7.0, record.y[20:]),
        0.1,
        segments=(20, 40),
    )
    before, after = (regressor_matrix(terms, each, 5) for each in (record, spoiled))
    np.testing.assert_array_equal(before[:, 15:], after[:, 15:])
    assert not np.any(before[:, :15] == after[:, :15])


def test_rows_do_not_read_the_present_or_the_future():
    record, terms = noise(40), [of("y(k-1)*u(k-2)"), of("tanh(u(k-1) - y(k-4))")]
    later = Dataset(
        np.append(record.u[:30, 0], record.u[30:, 0] + 9.0),
        np.append(record.y[:30], record.y[30:] - 9.0),
        0.1,
    )
    before, after = (regressor_matrix(terms, each, 4) for each in (record, later))
    np.testing.assert_array_equal(before[:, :27], after[:, :27])
    assert before[0, 27] != after[0, 27]


@pytest.mark.parametrize("samples", [CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK + 5])
def test_stretches_of_rows_are_contiguous(samples):
    record = noise(samples + 2)
    found = regressor_matrix([of("y(k-1)*u(k-2)"), of("u(k-1) - u(k-2)"), of("3")], record, 2)
    y, u = record.y, record.u[:, 0]
    np.testing.assert_array_equal(found, [y[1:-1] * u[:-2], u[1:-1] - u[:-2], np.ones(samples)])


def test_terms_may_have_many_factors_and_constants():
    record = noise(30)
    found = regressor_matrix([of("y(k-1)^3*u(k-1)^3"), of("abs(2*y(k-1) + 0.5)")], record, 1)
    y, u = record.y[:-1], record.u[:-1, 0]
    np.testing.assert_allclose(found, [(y * u) ** 3, 2.0 * np.abs(y + 0.25) / 2.0], rtol=1e-14)


def test_user_defined_primitive_equals_its_python_function():
    def backlash(a, b):
        return a - math.tanh(b) if a > b else a * b

    table = {**PRIMITIVES, "backlash": primitive("backlash", backlash)}
    record = noise(300, inputs=2)
    found = regressor_matrix([of("backlash(u1(k-1), y(k-2))*u2(k-1)", table)], record, 2)
    expected = [
        backlash(u, y) * v
        for u, y, v in zip(
            record.u[1:-1, 0].tolist(), record.y[:-2].tolist(), record.u[1:-1, 1].tolist(), strict=True
        )
    ]
    np.testing.assert_allclose(found[0], expected, rtol=1e-15)


SEGMENTS = ((1000,), (100, 300, 7, 593), (CHUNK + 3, CHUNK + 3, CHUNK + 3), (3 + CHUNK // 2,) * 4)


def products(terms, record, warm_up):
    """Return the inner products of the columns, in the order of 32 padded stretches per segment."""
    columns = regressor_matrix(terms, record, warm_up)
    rows = [end - begin - warm_up for begin, end in record.bounds if end - begin > warm_up]
    filled = side_by_side(columns, rows)
    return [[dot(one, 0, other, 0, one.size) for other in filled] for one in filled]


@pytest.mark.parametrize("segments", SEGMENTS)
def test_gram_matrix_equals_the_inner_products_bit_for_bit(segments):
    record = noise(sum(segments), segments, inputs=2)
    terms = [
        of("y(k-1)"),
        of("u1(k-3)*y(k-2)^2"),
        of("exp(u2(k-1))"),
        of("1"),
        of("sign(u1(k-1) - u1(k-2))"),
        Lagged(0),
    ]
    np.testing.assert_array_equal(gram_matrix(terms, record, 3), products(terms, record, 3))


@pytest.mark.ci
@given(records(longest=400), st.lists(regressors(height=2), min_size=1, max_size=3))
def test_gram_matrix_equals_the_inner_products_for_any_segments(record, terms):
    warm_up = max(item.maximum_lag for item in terms)
    assume(max(record.segments) > warm_up)
    np.testing.assert_array_equal(gram_matrix(terms, record, warm_up), products(terms, record, warm_up))


def test_estimation_rows_follow_the_warm_up_of_every_segment():
    found = select_rows(ramp((3, 5, 2, 4)), 3)
    assert found.count == 3
    # A stretch has at most one row: two rows in two lanes, and one; a chunk per segment.
    assert found.apart.tolist() == [1, 1]
    assert found.lanes.tolist() == [[2, *[0] * 7], [1, *[0] * 7]]
    assert found.row[:, 0].tolist() == [0, 2]
    for begin, sample in zip(found.offset, (6, 13), strict=True):
        assert begin % 32 == 0
        y, u = found.signals[:, begin - 3 * 32 : begin + 32 : 32]
        assert y.tolist() == [sample - 3, sample - 2, sample - 1, sample]
        assert u.tolist() == [100.0 * k for k in y]
    assert found.signals[0, found.offset[0] + 1] == 7.0


def test_gram_matrix_of_a_ramp_equals_a_hand_calculation():
    # Rows 1 .. 3: y(k) = 1, 2, 3 and u(k-1) = 0, 100, 200.
    assert gram_matrix([of("u(k-1)"), Lagged(0, 0)], ramp((4,)), 1).tolist() == [
        [50000.0, 800.0],
        [800.0, 14.0],
    ]


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
def test_missing_output_is_refused_with_its_sample(matrix):
    y = np.arange(10.0)
    y[[6, 8]] = np.nan
    with pytest.raises(
        RecordError, match="x is missing at sample 6: estimation needs every sample, cut the record"
    ):
        matrix([of("u(k-1)")], Dataset(np.ones(10), y, 0.1, output_name="x"), 1)


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
def test_record_shorter_than_the_warm_up_is_refused_with_both_lengths(matrix):
    with pytest.raises(
        RecordError, match="the longest recording has 5 samples and 5 are needed before the first row"
    ):
        matrix([of("u(k-5)")], ramp((3, 5)), 5)


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
@pytest.mark.parametrize("warm_up", [-1, 0, 4])
def test_warm_up_shorter_than_the_largest_lag_is_refused(matrix, warm_up):
    with pytest.raises(SettingsError, match=f"the terms read 5 samples back, the warm-up has {warm_up}"):
        matrix([of("y(k-1)"), of("exp(u(k-5))")], ramp((20,)), warm_up)


@pytest.mark.parametrize("matrix", [regressor_matrix, gram_matrix])
def test_missing_input_is_refused(matrix):
    with pytest.raises(RecordError, match=f"the terms read input {INPUTS}, the record has 1"):
        matrix([of(f"y(k-1)*u{INPUTS}(k-1)")], ramp((20,)), 1)


def test_constant_needs_no_warm_up():
    assert regressor_matrix([Constant(2.5)], ramp((2, 1)), 0).tolist() == [[2.5, 2.5, 2.5]]


def test_empty_list_of_terms_gives_no_columns():
    assert regressor_matrix([], ramp((4,)), 1).shape == (0, 3)
    assert gram_matrix([], ramp((4,)), 1).shape == (0, 0)


linked = st.lists(regressors(), min_size=1, max_size=4)


@pytest.fixture(scope="module")
def called():
    return {row_address(entry): entry for entry in PRIMITIVES.values()}


def interpreted(program, signal, operations, called, product=math.prod):
    """Execute a program on single values; return the terms and the computed values in order."""
    rows = [*program.constants.tolist(), *[None] * (program.temporaries - len(program.constants))]
    computed = []

    def read(operand):
        channel, lag = program.operands[operand].tolist()
        return rows[lag] if channel == TEMPORARY else signal(channel, lag)

    for (operation, target, *operands), address in zip(program.code, program.addresses, strict=True):
        arity = called[address].arity if operation == CALL else 1 if operation == SIGN else 2
        compute = called[address].scalar if operation == CALL else operations[operation]
        computed.append(compute(*[read(operand) for operand in operands[:arity]]))
        rows[target] = computed[-1]
    factors = zip(program.factors, program.degree, strict=True)
    return [product(map(read, linked[:degree])) for linked, degree in factors], computed


@given(linked, signals())
def test_program_computes_its_terms_despite_reused_rows(called, terms, signal):
    try:
        expected = [value(item.expression, signal) for item in terms]
    except ValueError:  # the sine of an infinite value
        assume(False)
    found, _ = interpreted(link(terms), signal, NUMBERS, called)
    np.testing.assert_array_equal(found, expected)


@given(linked)
def test_no_expression_is_computed_twice(called, terms):
    def written(name):
        return lambda *arguments: f"{name}({', '.join(map(str, arguments))})"

    class Named:
        def __init__(self, entry):
            self.arity, self.scalar = entry.arity, written(entry.name)

    symbols = {address: Named(entry) for address, entry in called.items()}
    operations = {operation: written(f"instruction {operation}") for operation in NUMBERS}
    program = link(terms)
    _, computed = interpreted(program, lambda *place: f"x{place}", operations, symbols, product=list)
    assert len(set(computed)) == len(computed) == len(program.code)


@given(linked)
def test_target_is_never_the_row_of_an_operand_or_constant(terms):
    program = link(terms)
    for _, target, first, second in program.code:
        assert target >= len(program.constants)
        assert target < program.temporaries
        for operand in (first, second):
            assert tuple(program.operands[operand]) != (TEMPORARY, target)


@given(linked)
def test_every_result_is_read(terms):
    program = link(terms)
    unread = set()
    for _, target, *operands in program.code.tolist():
        unread -= {program.operands[operand, 1] for operand in operands if program.operands[operand, 0] < 0}
        assert target not in unread
        unread.add(target)
    last = [program.operands[operand] for operand in program.factors.ravel()]
    assert unread <= {index for channel, index in last if channel == TEMPORARY}


def linked(*texts):
    return link([regressor(parse(text))[1] for text in texts])


def operations(program):
    return program.code[:, 0].tolist()


def test_shared_subexpression_is_computed_once():
    alone = linked("exp(u(k-1) - u(k-2))*y(k-1)")
    both = linked("exp(u(k-1) - u(k-2))*y(k-1)", "tanh(exp(u(k-1) - u(k-2)))", "u(k-1) - u(k-2)")
    assert operations(alone) == [SUBTRACT, CALL]
    assert operations(both) == [SUBTRACT, CALL, CALL]


@pytest.mark.parametrize("text", ["sign(u(k-1) - u(k-2))", "phi2(u(k-1), u(k-2))"])
def test_sign_of_a_difference_is_one_instruction(text):
    assert operations(linked(text)) == [SIGN_OF_DIFFERENCE]
    assert operations(linked("sign(u(k-1)*y(k-2))")) == [SIGN_OF_PRODUCT]
    assert operations(linked("sign(u(k-1)*u(k-2)*y(k-2))")) == [MULTIPLY, SIGN_OF_PRODUCT]
    assert operations(linked("sign(u(k-1) + u(k-2))")) == [ADD, SIGN]


def test_negative_summand_is_subtracted():
    assert operations(linked("u(k-1) - u(k-2) + u(k-3)")) == [SUBTRACT, ADD]
    assert operations(linked("u(k-1) - u(k-2)*y(k-1) + u(k-3)")) == [ADD, MULTIPLY, SUBTRACT]


def test_long_products_share_common_factors():
    program = linked("y(k-1)^6", "y(k-1)^7")
    assert operations(program) == [MULTIPLY] * 3


def test_products_of_up_to_four_factors_need_no_instruction():
    program = linked("y(k-1)*u(k-3)^2*u(k-1)", "y(k-1)")
    assert (len(program.code), program.temporaries) == (0, 0)
    assert program.degree.tolist() == [4, 1]
    terms = [
        program.operands[row[:degree]].tolist()
        for row, degree in zip(program.factors, program.degree, strict=True)
    ]
    assert terms == [[[0, 1], [1, 1], [1, 3], [1, 3]], [[0, 1]]]


@pytest.mark.parametrize("power", [5, 6, 9])
def test_more_than_four_factors_are_multiplied_beforehand(power):
    program = linked(f"u(k-1)^{power}")
    assert program.degree.tolist() == [MAX_FACTORS]
    assert operations(program) == [MULTIPLY] * (power - MAX_FACTORS)
    found, _ = interpreted(program, lambda *_: 3.0, NUMBERS, {})
    assert found == [3.0**power]


def test_constants_occupy_the_first_rows_once_each():
    program = linked("exp(2*u(k-1))", "tanh(2*y(k-1) + 10)", "1")
    assert program.constants.tolist() == [2.0, 5.0, 1.0]
    assert program.temporaries > 3
    assert program.operands[program.factors[2, 0]].tolist() == [TEMPORARY, 2]


def test_row_is_reused_after_the_last_read_of_its_value():
    text = "u(k-1)"
    for _ in range(10):
        text = f"tanh({text} + y(k-1))"
    program = linked(text)
    assert len(program.code) == 20
    assert program.temporaries == 2


def test_terms_keep_the_given_order():
    program = linked("u(k-3)", "y(k-1)", "u(k-3)", "u2(k-1)")
    heads = program.operands[program.factors[:, 0]].tolist()
    assert heads == [[1, 3], [0, 1], [1, 3], [2, 1]]


def test_expression_may_read_the_present():
    program = link([Lagged(0, 0)])
    assert program.operands[program.factors[0, 0]].tolist() == [0, 0]


def test_empty_list_of_terms_gives_an_empty_program():
    program = link([])
    assert [array.shape for array in (program.code, program.operands, program.factors, program.degree)] == [
        (0, 4),
        (0, 2),
        (0, MAX_FACTORS),
        (0,),
    ]


def test_same_terms_give_the_same_program():
    texts = ("exp(u(k-1))*y(k-2)", "sign(u(k-1) - u(k-2))*u(k-1)", "max(y(k-1), 2)")
    for one, other in zip(linked(*texts), linked(*texts), strict=True):
        np.testing.assert_array_equal(one, other)
