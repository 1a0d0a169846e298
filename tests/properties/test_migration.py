"""Laws of migration: who leaves an island, who arrives, and that an epoch is its steps and nothing else."""

from dataclasses import fields, replace
from functools import cache
from itertools import chain
from math import inf, isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import founded
from islands.evolution.characters import CHARACTERS
from islands.evolution.engine import SerialEngine
from islands.evolution.epoch import advance, emigrants, immigrated, next_stop
from islands.evolution.evaluation import Evaluator, Limits
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import Individual
from islands.evolution.island import Island, elite_of, first_generation, step
from islands.evolution.migration import EMIGRANTS, REPLACED
from islands.evolution.problem import Problem, problem
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.evolution.topology import topology
from islands.model.expression import Apply, Lagged, height, walk
from islands.simulation.outcome import Verdict
from support.searches import SMALL, exactly, islands_of, record

#: Individuals fail now and then, and copies get into the elite.
SETTINGS = replace(
    SMALL,
    population=6,
    elite=0.5,
    migrate_every=3,
    migrants=2,
    constraints="none",
    structure="free",
    primitives=("mul", "phi1", "phi2", "tanh", "cube"),
)

every_emigrants = pytest.mark.parametrize("leave", EMIGRANTS)
every_replaced = pytest.mark.parametrize("replaced", REPLACED)
every_character = pytest.mark.parametrize("character", CHARACTERS)


def never():
    return False


@cache
def recorded():
    return record(150)


@cache
def evaluator():
    return Evaluator(recorded(), SETTINGS)


@cache
def folk():
    """Everybody who lived in two short runs: models, failures, and some who were abandoned."""
    larger = Evaluator(recorded(), replace(SETTINGS, population=40))
    found = chain(*(island.population for seed in (1, 2) for island in islands_of(larger, 4, seed)))
    return list({each.key: each for each in found}.values())


def models():
    return [each for each in folk() if isfinite(each.fitness)]


@cache
def known_fitness(genes):
    patient = Evaluator(recorded(), SETTINGS, abandon=False)
    return patient.evaluate([(Individual(genes), False)])[0][0].fitness


def keys(population):
    return [each.key for each in population]


@st.composite
def islands(draw, distinct=False):
    """An island in the middle of a run, in whose elite and population are models and failures, and copies."""
    several = st.lists(st.sampled_from(folk()), min_size=SETTINGS.population, max_size=SETTINGS.population)
    population, others = draw(several), draw(several)
    elite = elite_of(others[: draw(st.integers(1, 6))], SETTINGS.elites, distinct)
    index, generation = draw(st.integers(0, 9)), draw(st.integers(0, 12))
    return Island(index, 3, generation, tuple(population), elite, with_entries(HallOfFame(), others), 1.0)


@st.composite
def arrivals(draw):
    """Populations as they come from several sources; each individual an object of its own."""
    some = st.lists(st.sampled_from(models()), max_size=4)
    return [tuple(replace(each) for each in population) for population in draw(st.lists(some, max_size=4))]


def test_the_folk_of_these_tests_are_of_all_sorts():
    verdicts = [each.outcome.verdict for each in folk()]
    assert verdicts.count(Verdict.OK) > 30
    assert verdicts.count(Verdict.ABANDONED) > 10
    assert len(set(verdicts)) > 2


# Who leaves.


@every_emigrants
@given(islands(), st.integers(0, 5))
def test_emigrants_are_members_with_a_known_fitness_each_structure_once(leave, island, count):
    setting = replace(SETTINGS, emigrants=leave, migrants=count, migrate_every=1)
    leaving = emigrants(replace(island, generation=4), setting)
    assert len(leaving) <= count
    assert all(isfinite(each.fitness) for each in leaving)
    assert len(set(keys(leaving))) == len(leaving)
    assert all(each in island.elite for each in leaving)


@every_emigrants
@given(islands())
def test_nobody_leaves_but_at_a_stop(leave, island):
    setting = replace(SETTINGS, emigrants=leave, migrate_every="3,8:2", elite=1.0)
    island = replace(island, elite=(models()[0],), hall=with_entries(HallOfFame(), models()[:1]))
    leaving = [
        len(emigrants(replace(island, generation=generation), setting)) for generation in range(-1, 13)
    ]
    assert leaving == [int(generation in (3, 6, 8, 10, 12)) for generation in range(-1, 13)]


@every_emigrants
def test_as_many_leave_as_the_schedule_says(leave):
    sizes = {each.size: each for each in sorted(models(), key=lambda each: (-each.size, -each.fitness))}
    # Every larger model is fitter: all are on the front.
    people = tuple(replace(each, fitness=1.0 / size) for size, each in sizes.items())
    assert len(people) > 3
    island = Island(0, 3, 0, people, people, with_entries(HallOfFame(), people))
    setting = replace(SETTINGS, emigrants=leave, migrants="2,9:0,12:3", migrate_every=1)
    counted = [len(emigrants(replace(island, generation=each), setting)) for each in (8, 9, 11, 12, 99)]
    assert counted == [2, 0, 0, 3, 3]
    many = replace(setting, population=1000, migrants=1000)
    assert len(emigrants(replace(island, generation=8), many)) == len(people)


@given(islands(), st.integers(1, 5))
def test_the_best_leave_first(island, count):
    leaving = EMIGRANTS["best"](island.elite, count, Stream(0, 0, 0, Purpose.EMIGRATION))
    fitness = {each.key: each.fitness for each in island.elite if isfinite(each.fitness)}
    assert [each.fitness for each in leaving] == sorted(fitness.values())[:count]


@pytest.mark.parametrize("leave", ["best", "random"])
def test_of_two_that_are_one_model_the_first_leaves(leave):
    one = next(each for each in models() if each.size > 1)
    copy = replace(one, genes=one.genes[::-1])
    assert copy != one
    leaving = EMIGRANTS[leave]((one, copy), 2, Stream(0, 0, 0, Purpose.EMIGRATION))
    assert leaving == (one,)


def front_of(elite):
    """Nobody of the elite is smaller and as fit, or fitter and as small; of equals the first."""
    worth = {each.key: (each.size, each.fitness) for each in reversed(elite) if isfinite(each.fitness)}
    beaten = {
        own
        for own in worth.values()
        if any(size <= own[0] and error <= own[1] and (size, error) != own for size, error in worth.values())
    }
    first = {(each.size, each.fitness): each for each in reversed(elite)}
    return [first[own] for own in dict.fromkeys(worth.values()) if own not in beaten]


@given(st.lists(st.tuples(st.sampled_from(folk()), st.sampled_from([None, 0.5, 1.0, 2.0])), max_size=30))
def test_the_front_is_who_nobody_of_the_elite_beats_in_error_and_size(drawn):
    people = {
        each.key: replace(each, fitness=error) if error and isfinite(each.fitness) else each
        for each, error in drawn
    }
    elite = elite_of(people.values(), 20, False)
    leaving = EMIGRANTS["front"](elite, len(elite), Stream(0, 0, 0, Purpose.EMIGRATION))
    assert sorted(map(id, leaving)) == sorted(map(id, front_of(elite)))


@pytest.mark.parametrize("leave", ["best", "random", "front"])
def test_whoever_is_in_the_hall_of_fame_alone_does_not_leave(leave):
    """Its genes are those that were estimated: variation could not breed from them."""
    small, *others = sorted(models(), key=lambda each: each.size)
    island = Island(0, 3, 4, (), tuple(others[-3:]), with_entries(HallOfFame(), [small, *others]))
    setting = replace(SETTINGS, emigrants=leave, migrants=3, migrate_every=1)
    assert set(keys(emigrants(island, setting))) <= set(keys(others[-3:]))


@pytest.mark.parametrize("leave", ["random", "front"])
def test_anyone_may_leave_and_every_place_of_a_run_draws_others(leave):
    elite = elite_of(models(), len(models()), True)
    elite = (*front_of(elite), *elite[:10])
    pool = {"random": elite, "front": front_of(elite)}[leave]
    assert len(pool) > 3
    setting = replace(SETTINGS, emigrants=leave, migrants=1, migrate_every=1)
    everywhere = [
        emigrants(Island(index, seed, generation, (), elite, HallOfFame()), setting)[0]
        for index in range(6)
        for seed in range(6)
        for generation in range(1, 7)
    ]
    assert set(keys(everywhere)) == set(keys(pool))


def test_the_draws_of_those_who_leave_know_island_generation_and_seed_and_are_their_own():
    elite = elite_of(models(), 20, True)
    setting = replace(SETTINGS, emigrants="random", migrants=6, migrate_every=1)
    island = Island(0, 3, 1, (), elite, HallOfFame())
    others = (replace(island, index=1), replace(island, generation=2), replace(island, seed=4))
    # 20 * 19 * .. * 15 orders: no two are the same by chance.
    assert len({emigrants(each, setting) for each in (island, *others, island)}) == 4
    for purpose in Purpose:
        drawn = EMIGRANTS["random"](elite, 6, Stream(3, 0, 1, purpose))
        assert (drawn == emigrants(island, setting)) == (purpose is Purpose.EMIGRATION)


@pytest.mark.parametrize("structure", ["free", "phi"])
@every_emigrants
def test_whoever_leaves_is_made_of_what_the_settings_allow(leave, structure):
    """Variation relies on it: a leaf that reads farther than any of its own may be put under back-shifts."""
    setting = replace(SMALL, emigrants=leave, migrants=9, migrate_every=1, structure=structure)
    for island in islands_of(Evaluator(recorded(), setting), 4)[1:]:
        leaving = emigrants(island, setting)
        assert leaving
        for gene in chain(*(each.genes for each in leaving)):
            assert height(gene) <= setting.max_height
            for node in walk(gene):
                assert not isinstance(node, Apply) or node.primitive.name in setting.primitives
                assert not isinstance(node, Lagged) or node.lag == 1


def test_a_long_search_breeds_from_the_front_without_a_gene_that_the_settings_forbid():
    """Genes that read farther than the settings let them are refused by the evaluator."""
    setting = replace(
        SMALL,
        emigrants="front",
        islands=4,
        topology="fully-connected",
        migrate_every=2,
        migrants=3,
        generations=40,
    )
    for epoch in SerialEngine().run(Problem(recorded(), setting), founded(4, 2), never):
        last = epoch.archipelago
    assert last.generation == 40


# Who arrives.


def expected(island, arriving):
    """Those who arrive, in the order of the sources, and by the first of a structure."""
    immigrants = []
    for each in chain(*arriving):
        if each.key not in keys(island.elite) and each.key not in keys(immigrants):
            immigrants.append(each)
    return immigrants[: len(island.population)]


@pytest.mark.parametrize("distinct", [False, True])
@every_replaced
@given(st.data(), arrivals())
def test_migration_conserves_sizes_and_all_who_are_not_replaced(replaced, distinct, data, arriving):
    island = data.draw(islands(distinct))
    setting = replace(SETTINGS, replaced=replaced, distinct=distinct)
    after = immigrated(island, arriving, evaluator(), setting)
    immigrants = expected(island, arriving)
    assert len(after.population) == len(island.population)
    fresh = [new for new, old in zip(after.population, island.population, strict=True) if new is not old]
    assert sorted(map(id, fresh)) == sorted(map(id, immigrants))
    assert replace(after, population=island.population, elite=island.elite) == island
    if not immigrants:
        assert exactly(after) == exactly(island)


@pytest.mark.parametrize("distinct", [False, True])
@every_replaced
@given(st.data(), arrivals())
def test_the_elite_is_the_best_of_itself_and_those_who_arrive(replaced, distinct, data, arriving):
    island = data.draw(islands(distinct))
    setting = replace(SETTINGS, replaced=replaced, distinct=distinct)
    after = immigrated(island, arriving, evaluator(), setting)
    contenders = [*island.elite, *expected(island, arriving)]
    # Nobody who arrives has the structure of another contender: distinct elites stay so.
    assert [each.fitness for each in after.elite] == sorted(each.fitness for each in contenders)[
        : SETTINGS.elites
    ]
    assert after.elite == elite_of(contenders, SETTINGS.elites, distinct)
    if len(island.elite) == SETTINGS.elites:
        assert len(after.elite) == SETTINGS.elites


def test_who_is_known_in_the_elite_does_not_arrive_again():
    one, two, *others = models()
    population = tuple(others[: SETTINGS.population])
    island = Island(0, 3, 6, population, (one,), HallOfFame())
    assert immigrated(island, [(replace(one),), (replace(one),)], evaluator(), SETTINGS) == island
    # Who is known in the population alone does: there it may be bred away.
    after = immigrated(island, [(replace(one), replace(population[0]))], evaluator(), SETTINGS)
    assert one not in after.population
    assert population[0] in after.elite
    assert two in immigrated(island, [(two, one)], evaluator(), SETTINGS).population


@every_replaced
def test_of_one_structure_the_first_source_s_arrives_and_of_too_many_the_first_ones(replaced):
    one, two, three, *others = models()
    island = Island(0, 3, 6, tuple(others[:2]), (others[3],), HallOfFame())
    again = replace(one, genes=one.genes[::-1])
    setting = replace(SETTINGS, replaced=replaced)
    after = immigrated(island, [(), (one,), (again, two), (three,)], evaluator(), setting)
    assert {id(each) for each in after.population} == {id(one), id(two)}


@given(islands(), arrivals())
def test_the_worst_are_replaced_by_what_they_are_worth_the_abandoned_too(island, arriving):
    after = immigrated(island, arriving, evaluator(), replace(SETTINGS, replaced="worst"))
    fitness = [known_fitness(each.genes) for each in island.population]
    places = sorted(range(len(fitness)), key=lambda place: (-fitness[place], place))
    for place, each in zip(places, expected(island, arriving), strict=False):
        assert after.population[place] is each


def test_anyone_may_be_replaced_and_every_place_of_a_run_draws_others():
    newcomer, member, *others = models()
    island = Island(0, 3, 1, tuple(others[:6]), (member,), HallOfFame())
    setting = replace(SETTINGS, replaced="random")

    def place(**changes):
        after = immigrated(replace(island, **changes), [(newcomer,)], evaluator(), setting)
        return after.population.index(newcomer)

    for name in ("index", "generation", "seed"):
        assert {place(**{name: value}) for value in range(40)} == set(range(6)), name
    drawn = [place(generation=generation) for generation in range(20)]
    for purpose in Purpose:
        streams = [Stream(3, 0, generation, purpose) for generation in range(20)]
        own = [REPLACED["random"](6, pytest.fail, 1, stream)[0] for stream in streams]
        assert (own == drawn) == (purpose is Purpose.IMMIGRATION)


@every_replaced
@given(islands(), arrivals())
def test_an_arrival_depends_on_nothing_that_an_evaluator_has_seen(replaced, island, arriving):
    setting = replace(SETTINGS, replaced=replaced)
    after = exactly(immigrated(island, arriving, evaluator(), setting))
    fresh = Evaluator(recorded(), SETTINGS)
    patient = Evaluator(recorded(), SETTINGS, Limits(pairs=0, genes=0, structures=0), abandon=False)
    barred = Evaluator(recorded(), SETTINGS)
    # It knows of everybody, but that they passed a bar.
    barred.evaluate([(Individual(each.genes), False) for each in island.population], [1e-9] * 9)
    for other in (fresh, patient, barred, fresh):
        assert exactly(immigrated(island, arriving, other, setting)) == after


def courses(setting, abandon, seed=5):
    """Every island's epochs, one after the other, and how many stood abandoned where somebody arrived."""
    posed, judge = Problem(recorded(), setting), Evaluator(recorded(), setting, abandon=abandon)
    sources = topology(setting.topology, setting.islands, seed).sources
    archipelago, leaving = founded(setting.islands, seed).islands, [()] * setting.islands
    found, abandoned = [], 0
    while archipelago[0].generation < setting.generations:
        if any(leaving):
            everybody = chain(*(island.population for island in archipelago))
            abandoned += sum(each.outcome.verdict is Verdict.ABANDONED for each in everybody)
        epochs = [
            advance(island, [leaving[source] for source in sources[island.index]], judge, posed, never)
            for island in archipelago
        ]
        archipelago, leaving = [epoch.island for epoch in epochs], [epoch.emigrants for epoch in epochs]
        found.append(epochs)
    return found, abandoned


@every_replaced
def test_a_run_with_migration_is_that_of_one_that_abandons_nobody(replaced):
    setting = replace(
        SMALL,
        islands=3,
        topology="bidirectional-ring",
        generations=8,
        migrate_every=2,
        migrants=3,
        replaced=replaced,
        characters=("plain", "explorer"),
    )
    (hasty, given_up), (patient, settled) = courses(setting, True), courses(setting, False)
    assert settled == 0
    # The law says nothing where nobody is given up.
    assert given_up > 10
    assert len(hasty) == 5
    for one, other in zip(chain(*hasty), chain(*patient), strict=True):
        assert repr(one.emigrants) == repr(other.emigrants)
        assert repr(one.island.hall) == repr(other.island.hall)
        assert repr(one.island.elite) == repr(other.island.elite)
        assert [each.genes for each in one.island.population] == [
            each.genes for each in other.island.population
        ]


# An epoch.


@pytest.fixture(scope="module")
def posed():
    """With a library: its seeds found an island, and its genes are in the pool."""
    setting = replace(
        SMALL,
        population=12,
        elite=0.5,
        generations=8,
        migrate_every=3,
        library="phi-polynomial",
        library_degree=2,
        from_library=0.5,
        characters=("pruner", "explorer"),
    )
    return problem(recorded(), setting)


def advanced(island, posed, arriving=(), judge=None):
    return advance(island, arriving, judge or Evaluator(posed.record, posed.settings), posed, never)


def begun(posed, index=0):
    """Islands at the end of the first epochs: generations 0, 3 and 6."""
    epochs = [advanced(Island(index, 7, -1, (), (), HallOfFame()), posed)]
    epochs.append(advanced(epochs[-1].island, posed))
    epochs.append(advanced(epochs[-1].island, posed))
    return epochs


@pytest.mark.parametrize("index", [0, 1])
def test_an_epoch_is_its_steps_one_by_one(posed, index):
    judge, setting = Evaluator(posed.record, posed.settings), posed.settings_of(index)
    founding, first, second = begun(posed, index)
    island, info = first_generation(index, 7, judge, posed.seeds, setting)
    assert exactly(founding.island) == exactly(island)
    assert (founding.steps, founding.emigrants) == ((info,), ())
    for epoch in (first, second):
        infos = []
        for _ in range(3):
            island, info = step(island, judge, posed.pool, setting)
            infos.append(info)
        assert exactly(epoch.island) == exactly(island)
        assert epoch.steps == tuple(infos)
        assert epoch.emigrants == emigrants(island, setting)
        assert len(epoch.emigrants) == 1


@every_replaced
def test_an_epoch_begins_with_those_who_arrive(posed, replaced):
    posed = replace(posed, settings=replace(posed.settings, replaced=replaced, migrants=6))
    here, there = begun(posed, 0)[1], begun(posed, 1)[1]
    judge = Evaluator(posed.record, posed.settings)
    arrived = immigrated(here.island, [there.emigrants], judge, posed.settings_of(0))
    assert arrived != here.island
    after = advanced(here.island, posed, [there.emigrants])
    infos = []
    for _ in range(3):
        arrived, info = step(arrived, judge, posed.pool, posed.settings_of(0))
        infos.append(info)
    assert exactly(after.island) == exactly(arrived)
    assert after.steps == tuple(infos)
    assert after.island != advanced(here.island, posed).island


def test_who_arrives_is_bred_from():
    fittest, *others = sorted(models(), key=lambda each: each.fitness)
    island = Island(0, 3, 3, tuple(others[-6:]), tuple(others[-3:]), HallOfFame())
    copies = Problem(recorded(), replace(SETTINGS, crossover=0.0, mutation=0.0, prune=0.0, generations=4))
    assert fittest.key in keys(advanced(island, copies, [(fittest,)]).island.population)
    assert fittest.key not in keys(advanced(island, copies).island.population)


def test_epochs_without_arrivals_compose(posed):
    """Two epochs of three generations are one of six: a stop by itself changes nothing."""
    founding, first, second = begun(posed)
    longer = replace(posed, settings=replace(posed.settings, migrate_every=6))
    whole = advanced(founding.island, longer)
    assert exactly(whole.island) == exactly(second.island)
    assert whole.steps == first.steps + second.steps
    assert whole.emigrants == second.emigrants


def test_a_run_that_ends_between_two_stops_goes_on_as_if_never_stopped(posed):
    *_, sixth = begun(posed)
    last = advanced(sixth.island, posed)
    assert [info.generation for info in last.steps] == [7, 8]
    assert last.emigrants == ()
    longer = replace(posed, settings=replace(posed.settings, generations=20))
    assert exactly(advanced(last.island, longer).island) == exactly(advanced(sixth.island, longer).island)


def test_an_epoch_ends_at_the_next_stop_or_with_the_run():
    setting = replace(SETTINGS, migrate_every="3,7:2", generations=12)
    assert [next_stop(generation, setting) for generation in range(-1, 12)] == [
        *(0, 3, 3, 3, 6, 6, 6, 7, 9, 9, 11, 11, 12)
    ]
    assert next_stop(-1, replace(setting, generations=0)) == 0
    assert next_stop(0, replace(setting, generations=2)) == 2


@pytest.mark.parametrize("asked", [1, 2, 3])
def test_who_is_told_to_stop_brings_nothing_back(posed, asked):
    founding, first, _ = begun(posed)
    judge, answers = Evaluator(posed.record, posed.settings), iter([False] * (asked - 1) + [True])
    assert advance(founding.island, [], judge, posed, lambda: next(answers)) is None
    assert list(answers) == []
    # What has been done of the epoch is lost, and harms nobody.
    assert exactly(advanced(founding.island, posed, judge=judge).island) == exactly(first.island)


def test_it_is_asked_before_every_generation_and_not_after_the_last(posed):
    founding, first, _ = begun(posed)
    answers = iter([False] * 3)
    epoch = advance(
        founding.island, [], Evaluator(posed.record, posed.settings), posed, lambda: next(answers)
    )
    assert list(answers) == []
    assert exactly(epoch.island) == exactly(first.island)
    before_the_first = Island(0, 7, -1, (), (), HallOfFame())
    assert advance(before_the_first, [], evaluator(), Problem(recorded(), SETTINGS), lambda: True) is None


# Characters.

#: All that a character may change: not one of these says what an individual means, or what it is worth.
BREEDING = {"crossover", "mutation", "prune", "tournament", "high_level", "outer", "from_library"}


@every_character
def test_a_character_changes_only_how_an_island_breeds(character):
    assert CHARACTERS[character].keys() <= BREEDING


def test_characters_are_given_out_in_turn():
    given_out = tuple(CHARACTERS)
    posed = Problem(recorded(), replace(SETTINGS, characters=given_out))
    for island in range(3 * len(given_out)):
        character = CHARACTERS[given_out[island % len(given_out)]]
        for field in fields(Settings):
            value = getattr(posed.settings_of(island), field.name)
            assert value == character.get(field.name, getattr(posed.settings, field.name)), field.name


def test_without_characters_all_islands_have_the_problem_s_settings():
    posed = Problem(recorded(), SETTINGS)
    assert all(posed.settings_of(island) is SETTINGS for island in range(3))
    plain = Problem(recorded(), replace(SETTINGS, characters=("plain",)))
    assert plain.settings_of(5) == plain.settings


@every_character
def test_a_character_breeds_otherwise_and_only_plain_does_not(character):
    alone = Problem(recorded(), replace(SETTINGS, population=12))
    alike = replace(alone, settings=replace(alone.settings, characters=(character,)))
    island = islands_of(Evaluator(recorded(), alone.settings), 1)[-1]
    one, other = advanced(island, alone), advanced(island, alike)
    assert (exactly(one.island) == exactly(other.island)) == (character == "plain")


@every_character
def test_an_individual_is_worth_the_same_on_an_island_of_any_character(character):
    posed = Problem(recorded(), replace(SETTINGS, characters=(character,)))
    epoch = advanced(Island(0, 3, -1, (), (), HallOfFame()), posed)
    population = [each for each in epoch.island.population if each.fitness < inf]
    assert population
    own = Evaluator(recorded(), posed.settings_of(0))
    asked = [
        (Individual(each.genes), pruned) for each in (*population, *models()) for pruned in (False, True)
    ]
    assert repr(own.evaluate(asked)) == repr(Evaluator(recorded(), SETTINGS).evaluate(asked))
    exact, _ = evaluator().evaluate([(Individual(each.genes), False) for each in population])
    assert repr(list(exact)) == repr(population)
