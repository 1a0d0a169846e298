"""C: its syntax, and the functions of a program of an extended simulation."""

from islands.export.equations.c.operators import C_OPERATORS
from islands.export.equations.language import Language
from islands.export.languages.bodies import function_name
from islands.export.languages.c import definition

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

EQUATION_FUNCTIONS = """\
simulate() computes the output of a record; differentiate(), read_output() and advance_states() are the
 * equations, their output and one step of the integration. PARAMETERS and INITIAL_STATES are those of the
 * diagnosis; change copies of them. Example:"""

SAMPLED_FUNCTIONS = """\
simulate() computes the output of a record; read_output() is the equation of the output. PARAMETERS and
 * INITIAL_STATES are those of the diagnosis; change copies of them. Example:"""

SIGNAL = """\
/* The signal {name} of the equations. */
static double signal_{name}(const struct parameters *p, const struct record *r, size_t step, double part)
{{
    {unused}return {value};
}}

"""

#: Definitions of the functions in `islands.export.equations.statements.DEFINED`.
_DEFINITIONS = {
    "less": "static double less(double a, double b) { return a < b ? 1.0 : 0.0; }",
    "less_equal": "static double less_equal(double a, double b) { return a <= b ? 1.0 : 0.0; }",
    "sign": "static double sign_of(double a) { return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : 0.0; }",
    "min": "static double minimum(double a, double b) { return a < b ? a : b; }",
    "max": "static double maximum(double a, double b) { return b < a ? a : b; }",
    "where": "static double choose(double condition, double a, double b) { return condition > 0.0 ? a : b; }",
}

C = Language(
    indent=4,
    continuation="",
    member="->",
    declare="const double ",
    variable="double ",
    alias="const double *const ",
    define=lambda primitive: definition(primitive, function_name(primitive)),
    zero="0.0",
    functions={"abs": "fabs"},
    power="pow({}, {})",
    add="{} += {};",
    condition="if ({}) {}",
    first=0,
    at="{}[{}]",
    past="{}[k - {}]",
    delayed="k < {0} ? 0 : k - {0}",
    loop="for (size_t k = {}; k < r->samples; ++k) {{",
    end="}",
    context=(),
    step="STEP",
    time="((double)step + part)*STEP",
    sample_time="(double)k*DT",
    part="step/PART_STEPS",
    give="return {};",
    finish="return {};",
    clear="",
    value="mapped",
    rests="rests(x, samples)",
    output=(),
    simulate_core="if (samples > 0) simulate_core(p, initial, r, y);",
    add_forces="if (samples > 1) add_forces(p, initial, r, y);",
    program="""\
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
{signal_members}
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

{between}{band_limit}{readers}{gain}{gain_between}{rates}{wrappers}{signals}\
{variables}{derivatives}/* Return the output of the equations. */
double read_output(const struct parameters *p, const struct states *s, const struct signals *in)
{{
    {output}
}}

{move}{advance}{operators}{maps}{forces}{core}/*
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
""",
    loop_steps="""\
const struct signals in[3] = {
            read_signals(p, r, step, 0.0), read_signals(p, r, step, 0.5), read_signals(p, r, step, 1.0)};
        if (step % STEPS == 0) y[step/STEPS] = read_output(p, &s, &in[0]);
        advance_states(p, &s, in);""",
    loop_samples="""\
struct signals in = read_signals(p, r, step, 0.0);
        in.{simulated} = y[step];
        y[step] = read_output(p, &s, &in);""",
    derivatives="""\
/* Return the derivatives of the states. */
struct states differentiate(const struct parameters *p, const struct states *s, const struct signals *in)
{{
    struct states slope = {{0}};
    {derivatives}
    return slope;
}}

""",
    move="""\
/* Return the states after a time with given slopes. */
static struct states move(const struct states *s, double time, const struct states *slope)
{{
    struct states next = *s;
    {moves}
    return next;
}}

""",
    advance="""\
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

""",
    map="""\
/* {summary} */
static void {name}(const struct parameters *p, const struct record *r, double *x, double *rows)
{{
    const size_t samples = r->samples;
    {operators}for (size_t k = 0; k < samples; ++k) {{
        {statements}
    }}
}}

""",
    forces="""\
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

""",
    force_slopes="""\
/* Return the derivatives of the states of these forces. */
static struct states differentiate_forces(
    const struct parameters *p, const struct states *s, double x, double v)
{{
    struct states slope = {{0}};
    {slopes}
    return slope;
}}

""",
    force_steps="""\
        const double middle = 0.5*(x + end), rate = (end - x)/time;
        const struct states first = differentiate_forces(p, &s, x, rate);
        const struct states at_first = move(&s, 0.5*time, &first);
        const struct states second = differentiate_forces(p, &at_first, middle, rate);
        const struct states at_second = move(&s, 0.5*time, &second);
        const struct states third = differentiate_forces(p, &at_second, middle, rate);
        const struct states at_third = move(&s, time, &third);
        const struct states fourth = differentiate_forces(p, &at_third, end, rate);
        {advances}
""",
    core="""\
{functions}/* Write the simulated output. */
static void simulate_core(
    const struct parameters *p, const struct states *s, const struct record *r, double *y)
{{
    {lines}
}}

""",
    signals="""\
/* Return the signals, a part of a step after its start. */
static struct signals read_signals(
    const struct parameters *p, const struct record *r, size_t step, double part)
{{
    struct signals in = {{0}};
    {lines}
    return in;
}}

""",
    reader="""\
static double read_{name}(const struct parameters *p, const struct record *r, size_t step, double part)
{{
    {lines}
}}

""",
    gain="""\
/* Return the factor of the gain at the start of a part of a sample. */
static double read_gain(const struct parameters *p, size_t part)
{{
    const double t = (double)part*PART_STEPS*STEP;
    return {gain};
}}

""",
    gain_between="""\
/* Return the factor of the gain, which is linear within each part of a sample. */
static double interpolate_gain(const struct parameters *p, const struct record *r, size_t step, double part)
{
    const size_t j = step/PART_STEPS, next = (j + 1)*PART_STEPS < r->samples*STEPS ? j + 1 : j;
    const double f = ((double)(step % PART_STEPS) + part)/PART_STEPS;
    return read_gain(p, j) + f*(read_gain(p, next) - read_gain(p, j));
}

""",
    band_limit="""\
enum {{ REACH = {reach}, PHASES = {phases} }}; /* samples on each side, values per sample */

/* Return a value of the band-limited interpolation; both ends are extended by reflection. */
static double filter(const double *x, size_t samples, size_t value)
{{
    static const double weights[2*REACH + 1][PHASES] = {{
{weights}}};
    const long k = (long)(value/PHASES), last = (long)samples - 1;
    double sum = 0.0;
    for (long near = -REACH; near <= REACH; ++near) {{
        const long at = k + near;
        const double here = at < 0 ? 2.0*x[0] - x[-at] : at > last ? 2.0*x[last] - x[2*last - at] : x[at];
        sum += weights[near + REACH][value % PHASES]*here;
    }}
    return sum;
}}

/* Return a signal between samples: the parabola through three values of the filter. */
static double limit_band(const double *x, size_t samples, size_t step, double part)
{{
    const size_t value = 2*(step/PART_STEPS);
    const double start = filter(x, samples, value), f = ((double)(step % PART_STEPS) + part)/PART_STEPS;
    const double rise = filter(x, samples, value + 1) - start;
    const double second = filter(x, samples, value + 2) - filter(x, samples, value + 1);
    return start + f*(3.0*rise - second + f*2.0*(second - rise));
}}

""",
    pointer="""\
typedef double (*read_signal)(const struct parameters *p, const struct record *r, size_t step, double part);

""",
    moment="{}[3*step + (size_t)(2.0*part)]",
    between={
        "first-order": "interpolate({}, r->samples, step, part)",
        "zero-order": "hold({}, step)",
        "band-limited": "limit_band({}, r->samples, step, part)",
    },
    interpolations={
        "interpolate": """\
/* Return a signal that is linear between its samples, a part of a step after the start of the step. */
static double interpolate(const double *x, size_t samples, size_t step, double part)
{
    const size_t k = step/STEPS, next = k + 1 < samples ? k + 1 : k;
    return x[k] + ((double)(step % STEPS) + part)/STEPS*(x[next] - x[k]);
}

""",
        "hold": """\
/* Return a signal that is constant between its samples. */
static double hold(const double *x, size_t step)
{
    return x[step/STEPS];
}

""",
    },
    rates={
        "find_rate": """\
/* Return the rate of a signal: the derivative of the parabola through the values of a step. */
static double find_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double part)
{
    const double middle = read(p, r, step, 0.5);
    const double rise = middle - read(p, r, step, 0.0), second = read(p, r, step, 1.0) - middle;
    return (3.0*rise - second + 4.0*part*(second - rise))/STEP;
}

""",
        "find_limited_rate": """\
/* Return the rate of a signal with kinks: its integral, and that of its magnitude, are those of the signal by
   Simpson's rule. */
static double find_limited_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double part)
{
    const double middle = read(p, r, step, 0.5);
    const double rise = middle - read(p, r, step, 0.0), second = read(p, r, step, 1.0) - middle;
    const double near = part < 0.5 ? rise : second, far = part < 0.5 ? second : rise;
    const double largest = 2.0*(rise + second);
    if (part == 0.5) return (rise + second)/STEP;
    if (near*far < 0.0) return (fabs(near) >= fabs(far) ? 2.0*near - 4.0*far : 6.0*near)/STEP;
    return fmin(fmax(3.0*near - far, fmin(largest, 0.0)), fmax(largest, 0.0))/STEP;
}

""",
        "find_held_rate": """\
/* Return the rate of a signal that is held: that of a ramp to the next value within the step. */
static double find_held_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step)
{
    return step + 1 < r->samples*STEPS ? (read(p, r, step + 1, 0.0) - read(p, r, step, 0.0))/STEP : 0.0;
}

""",
        "find_central_rate": """\
/* Return the rate of a signal at a sample, by central differences. */
static double find_central_rate(
    read_signal read, const struct parameters *p, const struct record *r, size_t step)
{
    const size_t before = step > 0 ? step - 1 : 0, after = step + 1 < r->samples ? step + 1 : step;
    const double change = read(p, r, after, 0.0) - read(p, r, before, 0.0);
    return after > before ? change/((double)(after - before)*DT) : 0.0;
}

""",
        "delay": """\
/* Return a signal delayed by linear interpolation between half steps; before its start it is constant. */
static double delay(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double part,
    double tau)
{
    const size_t last = 2*r->samples*STEPS;
    const double at = fmin(fmax(2.0*((double)step + part - fmax(tau, 0.0)/STEP), 0.0), (double)last);
    const size_t lower = at < (double)last ? (size_t)at : last - 1, upper = lower + 1;
    const double first = read(p, r, lower/2, 0.5*(double)(lower % 2));
    const double second = upper < last ? read(p, r, upper/2, 0.5*(double)(upper % 2))
                                       : read(p, r, upper/2 - 1, 1.0);
    return first + (at - (double)lower)*(second - first);
}

""",
        "delay_held": """\
/* Return a held signal delayed by linear interpolation between steps, constant within each step. */
static double delay_held(
    read_signal read, const struct parameters *p, const struct record *r, size_t step, double tau)
{
    const double at = fmax((double)step - fmax(tau, 0.0)/STEP, 0.0);
    const size_t lower = (size_t)at, upper = lower + 1 < r->samples*STEPS ? lower + 1 : lower;
    const double first = read(p, r, lower, 0.0);
    return first + (at - (double)lower)*(read(p, r, upper, 0.0) - first);
}

""",
    },
    definitions=_DEFINITIONS,
    operators=C_OPERATORS,
)
