"""Parts of a C program of an extended simulation."""

#: Definitions of the functions in `islands.export.equations.statements.DEFINED`.
DEFINITIONS = {
    "less": "static double less(double a, double b) { return a < b ? 1.0 : 0.0; }",
    "less_equal": "static double less_equal(double a, double b) { return a <= b ? 1.0 : 0.0; }",
    "sign": "static double sign_of(double a) { return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : 0.0; }",
    "min": "static double minimum(double a, double b) { return a < b ? a : b; }",
    "max": "static double maximum(double a, double b) { return b < a ? a : b; }",
    "where": "static double choose(double condition, double a, double b) { return condition > 0.0 ? a : b; }",
}

HEAD = """\
/*
{heading}
 *
 * {functions}
 *
 *     struct record record = {{{example}}};
 *     simulate(&PARAMETERS, &INITIAL_STATES, &record, y);
 *
 * C99; link with -lm.
 */

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

{constants}{definitions}"""

#: Functions of a program, in its heading.
EQUATION_FUNCTIONS = """\
simulate() computes the output of a record; differentiate(), read_output() and advance_states() are the
 * equations, their output and one step of the integration. PARAMETERS and INITIAL_STATES are those of the
 * diagnosis; change copies of them. Example:"""
SAMPLED_FUNCTIONS = """\
simulate() computes the output of a record; read_output() is the equation of the output. PARAMETERS and
 * INITIAL_STATES are those of the diagnosis; change copies of them. Example:"""

BODY = """\
/* Parameters of the equations and of the effects. */
struct parameters {{
{parameters}
}};

/* States. */
struct states {{
{states}
}};

/* Signals that the equations read at one instant. */
struct signals {{
{signals}
}};

/* Columns of a record, each with this number of samples. */
struct record {{
    size_t samples;
{record}
}};

const struct parameters PARAMETERS = {{
{parameter_values}
}};

const struct states INITIAL_STATES = {{
{state_values}
}};

{reading}{variables}{derivatives}/* Return the output of the equations. */
double read_output(const struct parameters *p, const struct states *s, const struct signals *in)
{{
    {output}
}}

{integration}{operators}{maps}{forces}{core}/*
 * Simulate a record; write its output y. Return 0, or -1 if that is not possible, for example without memory.
 */
int simulate(const struct parameters *p, const struct states *initial, const struct record *record, double *y)
{{
    const size_t samples = record->samples;
    struct states s = *initial;
    struct record mapped = *record;
    const struct record *r = &mapped;
    {before}for (size_t step = 0; step < samples*STEPS; ++step) {{
        {loop}
    }}
    {after}return 0;
}}
"""

#: Statements of each step of the integration.
STEP = """\
const struct signals in[3] = {
            read_signals(p, r, step, 0.0), read_signals(p, r, step, 0.5), read_signals(p, r, step, 1.0)};
        if (step % STEPS == 0) y[step/STEPS] = read_output(p, &s, &in[0]);
        advance_states(p, &s, in);"""

#: Statements of each sample of a simulation in discrete time.
SAMPLE = """\
struct signals in = read_signals(p, r, step, 0.0);
        in.{simulated} = y[step];
        y[step] = read_output(p, &s, &in);"""

DERIVATIVES = """\
/* Return the derivatives of the states. */
struct states differentiate(const struct parameters *p, const struct states *s, const struct signals *in)
{{
    struct states slope = {{0}};
    {derivatives}
    return slope;
}}

"""

MOVE = """\
/* Return the states after a time with given slopes. */
static struct states move(const struct states *s, double time, const struct states *slope)
{{
    struct states next = *s;
    {moves}
    return next;
}}

"""

ADVANCE = """\
/* Advance the states by one step. The signals are those at its start, in its middle and at its end. */
void advance_states(const struct parameters *p, struct states *s, const struct signals in[3])
{{
    const struct states first = differentiate(p, s, &in[0]);
    const struct states at_first = move(s, 0.5*STEP, &first);
    const struct states second = differentiate(p, &at_first, &in[1]);
    const struct states at_second = move(s, 0.5*STEP, &second);
    const struct states third = differentiate(p, &at_second, &in[1]);
    const struct states at_third = move(s, STEP, &third);
    const struct states fourth = differentiate(p, &at_third, &in[2]);
    {advances}
}}

"""

MAP = """\
/* {summary} */
static void {name}(const struct parameters *p, const struct record *r, double *x, double *rows)
{{
    const size_t samples = r->samples;
    {operators}for (size_t k = 0; k < samples; ++k) {{
        {statements}
    }}
}}

"""

FORCES = """\
/* Return the forces on the output at a coordinate x with the rate v. */
static double sum_forces(const struct parameters *p, const struct states *s, double x, double v)
{{
    {forces}
    return {total};
}}

{slopes}/* Add the forces to the output. Their coordinate is the input, linear in each part of a sample. */
static void add_forces(
    const struct parameters *p, const struct states *initial, const struct record *r, double *y)
{{
    const size_t parts = r->samples*(STEPS/PART_STEPS);
    const double time = PART_STEPS*STEP;
    {states} states s = *initial;
    for (size_t j = 0; j < parts; ++j) {{
        const size_t before = j > 0 ? j - 1 : j, after = j + 1 < parts ? j + 1 : j;
        const double x = read_{input}(p, r, j*PART_STEPS, 0.0);
        const double end = read_{input}(p, r, after*PART_STEPS, 0.0);
        const double v = (end - read_{input}(p, r, before*PART_STEPS, 0.0))/((double)(after - before)*time);
        if (j % (STEPS/PART_STEPS) == 0) y[j/(STEPS/PART_STEPS)] += sum_forces(p, &s, x, v);
{steps}    }}
}}

"""

#: Derivatives of the states of forces.
FORCE_SLOPES = """\
/* Return the derivatives of the states of these forces. */
static struct states differentiate_forces(
    const struct parameters *p, const struct states *s, double x, double v)
{{
    struct states slope = {{0}};
    {slopes}
    return slope;
}}

"""

#: Integration of these states over one part of a sample.
FORCE_STEPS = """\
        const double middle = 0.5*(x + end), rate = (end - x)/time;
        const struct states first = differentiate_forces(p, &s, x, rate);
        const struct states at_first = move(&s, 0.5*time, &first);
        const struct states second = differentiate_forces(p, &at_first, middle, rate);
        const struct states at_second = move(&s, 0.5*time, &second);
        const struct states third = differentiate_forces(p, &at_second, middle, rate);
        const struct states at_third = move(&s, time, &third);
        const struct states fourth = differentiate_forces(p, &at_third, end, rate);
        {advances}
"""
