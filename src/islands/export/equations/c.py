"""C99: its syntax, the operators of maps, and the program of an extended simulation."""

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from islands.export.equations.extended_system import ExtendedEquations
from islands.export.equations.language import Language
from islands.export.equations.program import EquationProgram, map_function
from islands.export.languages.bodies import function_name
from islands.export.languages.c import definition
from islands.expressions.printing import render
from islands.expressions.tree import Symbol
from islands.records.segments import MAX_RANGE_AT_REST

#: Definition of each operator that is a function.
C_OPERATORS: Mapping[str, str] = MappingProxyType(
    {
        "low-pass": """\
/* First-order low-pass with a time constant; exact for a cubic through four neighbouring samples. */
static void low_pass(const double *x, double *z, size_t samples, double tau)
{
    static const double lagrange[4][4] = {
        {0.0, -1.0/3.0, 1.0/2.0, -1.0/6.0},
        {1.0, -1.0/2.0, -1.0, 1.0/2.0},
        {0.0, 1.0, 1.0/2.0, -1.0/2.0},
        {0.0, -1.0/6.0, 0.0, 1.0/6.0}};
    const double step = tau > 0.0 ? DT/tau : 0.0;
    double moments[4], weights[4] = {0.0, 0.0, 0.0, 0.0}, state = 0.0;
    if (!(tau > 0.0)) {
        for (size_t k = 0; k < samples; ++k) z[k] = x[k];
        return;
    }
    for (int n = 0; n < 4; ++n) {
        if (step < 1.0) { /* series of the integrals of step*exp(-step*(1 - s))*s^n over s from 0 to 1 */
            double power = 1.0, sum = 0.0;
            for (int m = 0; m < 20; ++m) {
                sum += power/(n + m + 1);
                power *= step/(m + 1);
            }
            moments[n] = step*exp(-step)*sum;
        } else {
            moments[n] = n == 0 ? 1.0 - exp(-step) : 1.0 - n/step*moments[n - 1];
        }
    }
    for (int i = 0; i < 4; ++i) {
        for (int n = 0; n < 4; ++n) weights[i] += lagrange[i][n]*moments[n];
    }
    for (size_t k = 0; k < samples; ++k) {
        const double before = k > 0 ? x[k - 1] - x[0] : 0.0, here = x[k] - x[0];
        const double next = x[k + 1 < samples ? k + 1 : samples - 1] - x[0];
        const double after = x[k + 2 < samples ? k + 2 : samples - 1] - x[0];
        z[k] = x[0] + state;
        state = exp(-step)*state + weights[0]*before + weights[1]*here + weights[2]*next + weights[3]*after;
    }
}
""",
        "resonance": """\
/* Second-order mode in series, by the bilinear transform, prewarped at its frequency. */
static void resonance(const double *x, double *z, size_t samples, double period, double zeta)
{
    const double w = period > 0.0 ? 2.0*acos(-1.0)/period : HUGE_VAL;
    double x1 = 0.0, x2 = 0.0, z1 = 0.0, z2 = 0.0;
    for (size_t k = 0; k < samples; ++k) {
        if (w*DT > 2.6) { /* faster than the record can show */
            z[k] = x[k];
        } else {
            const double q = w/tan(w*DT/2.0), scale = q*q + 2.0*zeta*w*q + w*w, b = w*w/scale;
            const double a1 = 2.0*(w*w - q*q)/scale, a2 = (q*q - 2.0*zeta*w*q + w*w)/scale;
            const double x0 = x[k] - x[0], z0 = b*x0 + 2.0*b*x1 + b*x2 - a1*z1 - a2*z2;
            x2 = x1;
            x1 = x0;
            z2 = z1;
            z1 = z0;
            z[k] = z0 + x[0];
        }
    }
}
""",
        "play": """\
/* Play with a half width. */
static void play(const double *x, double *z, size_t samples, double width)
{
    double at = x[0];
    for (size_t k = 0; k < samples; ++k) {
        if (!(width > 0.0)) at = x[k];
        else if (x[k] - width > at) at = x[k] - width;
        else if (x[k] + width < at) at = x[k] + width;
        z[k] = at;
    }
}
""",
        "slider": """\
/* Stick-slip slider: z is constant until x, held or continuous, differs from it by the breakaway, and then
   jumps to x. */
static void slider(const double *x, double *z, size_t samples, double breakaway)
{
    double at = x[0], most = 0.0;
    size_t equal = 0;
    for (size_t k = 0; k < samples; ++k) most = fmax(most, fabs(x[k]));
    for (size_t k = 1; k < samples; ++k) equal += fabs(x[k] - x[k-1]) <= MAX_RANGE_AT_REST*most;
    for (size_t k = 0; k < samples; ++k) {
        if (!(breakaway > 0.0)) at = x[k];
        else if (2*equal + 1 <= samples) at += breakaway*trunc((x[k] - at)/breakaway);
        else if (fabs(x[k] - at) > breakaway) at = x[k];
        z[k] = at;
    }
}
""",
        "limit-rate": """\
/* Rate limiter: z follows x, which is linear between its values, by at most a rate per second. There is one
   value for each sample, or three for each step: at its start, in its middle and at its end. */
static void limit_rate(const double *x, double *z, size_t count, double inverse_rate, int values)
{
    double at = x[0];
    z[0] = at;
    for (size_t k = 1; k < count; ++k) {
        const double interval = values == 1 ? DT : k % 3 == 0 ? 0.0 : 0.5*STEP;
        const double step = inverse_rate > 0.0 ? interval/inverse_rate : INFINITY;
        const double change = x[k] - x[k-1], gap = x[k-1] - at, closing = copysign(step, gap) - change;
        const double met = gap*closing > 0.0 ? gap/closing : gap == 0.0 ? 0.0 : 1.0;
        if (met >= 1.0) at += copysign(step, gap);
        else if (fabs(change) <= step) at = x[k];
        else at = x[k-1] + change*met + copysign(step, change)*(1.0 - met);
        z[k] = at;
    }
}
""",
        "lag-unevenly": """\
/* First-order lag of x, which is linear between samples. Its time constants are those of falling fast,
   falling slowly, rising slowly and rising fast: z' is above a rate per second, or below. */
static void lag_unevenly(const double *x, double *z, size_t samples, double slow, double falling_fast,
                         double falling, double rising, double rising_fast)
{
    const double least = 1e-9*DT, times[2][2] = {
        {fmax(falling, least), fmax(falling_fast, least)}, {fmax(rising, least), fmax(rising_fast, least)}};
    double gap = 0.0;
    z[0] = x[0];
    for (size_t k = 1; k < samples; ++k) {
        const double slope = (x[k] - x[k-1])/DT;
        double left = gap != 0.0 || slope != 0.0 ? DT : 0.0;
        while (left > 0.0) {
            const double side = copysign(1.0, gap != 0.0 ? gap : slope), rise = side*slope;
            const double *tau = times[side > 0.0];
            const double distance = side*gap, edge = slow*tau[0];
            const int fast = distance > edge || (distance == edge && rise > slow);
            const double lower = fast ? edge : 0.0, end = lower + tau[fast]*(rise - (fast ? slow : 0.0));
            const double change = end < lower ? lower : !fast && end > edge ? edge : -1.0;
            const double passed = change < 0.0 ? left : tau[fast]*log((distance - end)/(change - end));
            gap = passed < left ? side*change : side*(end + (distance - end)*exp(-left/tau[fast]));
            left -= passed;
        }
        z[k] = x[k] - gap;
    }
}
""",
        "lag-by-gap": """\
/* Lag of x, a cubic through four neighbouring samples, that grows with the gap:
   z' = gap/(tau + inverse_rate*|gap|). */
static void lag_by_gap(const double *x, double *z, size_t samples, double tau, double inverse_rate)
{
    const double step = DT/8.0, least = fmax(tau, 1e-9*DT), ratio = step/least;
    const double part = -1.0/expm1(-ratio) - 1.0/ratio;
    double gap = 0.0;
    z[0] = x[0];
    for (size_t k = 1; k < samples; ++k) {
        const double before = x[k > 1 ? k - 2 : 0], after = x[k + 1 < samples ? k + 1 : samples - 1];
        double at = x[k-1];
        for (int turn = 1; turn <= 8 && tau > 0.0; ++turn) {
            const double s = turn/8.0;
            const double next = s*(s - 1.0)*((s + 1.0)*after - (s - 2.0)*before)/6.0
                                + (s + 1.0)*(s - 2.0)*((s - 1.0)*x[k-1] - s*x[k])/2.0;
            const double ahead = gap + part*(next - at), size = fabs(ahead);
            const double half = 0.5*(least + part*step - inverse_rate*size);
            const double root = sqrt(half*half + inverse_rate*size*least);
            const double middle = half > 0.0 ? size*least/(half + root) : (root - half)/inverse_rate;
            gap += (copysign(middle, ahead) - gap)/part;
            at = next;
        }
        z[k] = x[k] - gap;
    }
}
""",
        "interpolate": """\
/* Signal at the time t*(1 + e) - tau - cosine*cos(2*pi*f*t) - sine*sin(2*pi*f*t), by Lagrange's polynomial
   through six samples; its ends are held. */
static void interpolate_at(const double *x, double *z, size_t samples, double e, double tau, double cosine,
                           double sine, double f_Hz)
{
    const long last = (long)samples - 1;
    for (long k = 0; k <= last; ++k) {
        const double angle = 6.283185307179586*f_Hz*DT*(double)k;
        const double late = (tau + cosine*cos(angle) + sine*sin(angle))/DT;
        const double at = fmin(fmax((double)k*(1.0 + e) - late, 0.0), (double)last);
        const long lower = (long)at < last - 1 ? (long)at : last - 1, first = lower > 0 ? lower : 0;
        const double f = at - (double)first;
        double sum = 0.0;
        for (long here = -2; here <= 3; ++here) {
            const long place = first + here < 0 ? 0 : first + here > last ? last : first + here;
            double weight = x[place];
            for (long other = -2; other <= 3; ++other) {
                if (other != here) weight *= (f - (double)other)/(double)(here - other);
            }
            sum += weight;
        }
        z[k] = sum;
    }
}
""",
        "rests": """\
/* Whether a signal is constant over the estimation part of the record that was diagnosed. */
static double rests(const double *x, size_t samples)
{
    double least = x[0], most = x[0];
    for (size_t k = 0; k < samples && k < FITTED; ++k) {
        least = fmin(least, x[k]);
        most = fmax(most, x[k]);
    }
    return most - least <= MAX_RANGE_AT_REST*fmax(fabs(least), fabs(most)) ? 1.0 : 0.0;
}
""",
    }
)

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


def c_equations(equations: ExtendedEquations) -> str:
    """Return an extended simulation of equations as C99 source in ASCII."""
    return _CProgram(equations).write()


class _CProgram(EquationProgram):
    language = C

    def __init__(self, equations: ExtendedEquations) -> None:
        super().__init__(equations)
        self.states = self.states or [("none", "0.0", "there are no states")]

    def describe_data(self) -> dict[str, str]:
        code = self.code
        signals = [(code.identifiers[render(each)], "", "") for each in code.signals]
        variables = [(code.identifiers[name], "", "") for name, _ in self.given.system.variables]
        moments = self.given.moment_maps
        parameters = code.list_parameters() or [("none", "0.0", "there are no parameters")]
        return {
            "parameters": _list_members(parameters),
            "states": _list_members(self.states),
            "signal_members": _list_members(signals or [("none", "", "")]),
            "record": "\n".join(f"    const double *{name};" for name in self.columns)
            + (f"\n    const double *{self.moments}; /* set by simulate() */" if moments else ""),
            "parameter_values": _list_values(parameters),
            "state_values": _list_values(self.states),
            "variables": "/* Variables of the equations. */\n"
            f"struct variables {{\n{_list_members(variables)}\n}};\n\n"
            if variables
            else "",
        }

    def complete(self, text: str) -> str:
        given, code = self.given, self.code
        values = (
            ("enum { STEPS = %s };", given.times * given.steps, "integration steps per sample"),
            ("enum { PART_STEPS = %s };", given.steps, "those of each part of a sample"),
            ("enum { FITTED = %s };", given.fitted, "samples of the estimation part"),
            ("static const double DT = %r;", given.dt, "sampling time in s"),
            (
                "static const double STEP = %r;",
                given.dt / (given.times * given.steps),
                "integration step in s",
            ),
            ("static const double MAX_RANGE_AT_REST = %r;", MAX_RANGE_AT_REST, "rounding"),
        )
        used = [
            f"{line % value} /* {why} */\n"
            for line, value, why in values
            if re.search(rf"\b{line.split(' = ')[0].split()[-1]}\b", text)
        ]
        head = HEAD.format(
            heading="\n".join(f" * {line}".rstrip() for line in code.describe()),
            functions=SAMPLED_FUNCTIONS if given.core else EQUATION_FUNCTIONS,
            example=", ".join(["samples", *self.columns, *["NULL"] * bool(given.moment_maps)]),
            constants="".join([*used, "\n"]),
            definitions="".join(
                f"{self.language.definitions[each]}\n\n" for each in code.find_functions(text)
            ),
        )
        return head + text

    def begin(self, lines: Sequence[str], *arguments: str) -> list[str]:
        text = "\n".join(lines)
        variables = ["struct variables w;"] if re.search(r"\bw\.", text) else []
        # Compilers warn about unused arguments.
        return variables + [f"(void){name};" for name in arguments if not re.search(rf"\b{name}\b", text)]

    def apply_operator(self, function: str, result: str, arguments: Sequence[str]) -> list[str]:
        texts = ", ".join(["x", result, "samples", *arguments])
        return [f"double *const {result} = rows + {result[1:]}*samples;", f"{function}({texts});"]

    def map_input(self) -> list[str]:
        given, lines = self.given, []
        if given.hold == "band-limited":
            lines.append("if (samples > 0 && samples <= REACH + 1) return -1; /* too short for the filter */")
        maps = [*given.input_maps, *given.output_maps]
        rows = max((len(signal_map.operators) for signal_map in maps), default=0)
        if maps:
            count = max(rows + bool(given.input_maps), 1)
            lines += [
                f"double *const rows = malloc({count}*(samples + 1)*sizeof *rows);",
                "if (rows == NULL) return -1;",
            ]
        if given.input_maps:
            lines += [
                f"double *const x = rows + {rows}*samples;",
                f"for (size_t k = 0; k < samples; ++k) x[k] = record->{self.input}[k];",
                *(
                    f"if (samples > 0) {map_function(signal_map)}(p, record, x, rows);"
                    for signal_map in given.input_maps
                ),
                f"mapped.{self.input} = x;",
            ]
        return lines + self._map_moments(has_rows=bool(maps))

    def _map_moments(self, has_rows: bool) -> list[str]:
        """Write the statements that compute the input at three moments of each step."""
        given = self.given
        if not given.moment_maps:
            return []
        value = self.interpolate(given.system.input)
        rows = max(len(signal_map.operators) for signal_map in given.moment_maps)
        failure = "{ free(rows); return -1; }" if has_rows else "return -1;"
        return [
            "struct record fine = mapped;",
            "fine.samples = 3*samples*STEPS;",
            f"double *const moments = calloc({rows + 1}*(fine.samples + 1), sizeof *moments);",
            f"if (moments == NULL) {failure}",
            "for (size_t j = 0; j < fine.samples; ++j) {",
            "    const size_t step = j/3;",
            "    const double part = 0.5*(double)(j % 3);",
            *(f"    {line}" for line in self.begin([value], "part")),
            f"    moments[j] = {value};",
            "}",
            *(
                f"if (samples > 0) {map_function(signal_map)}(p, &fine, moments, moments + fine.samples);"
                for signal_map in given.moment_maps
            ),
            f"mapped.{self.moments} = moments;",
        ]

    def map_output(self) -> list[str]:
        given = self.given
        lines = [f"if (samples > 0) {map_function(each)}(p, record, y, rows);" for each in given.output_maps]
        if given.moment_maps:
            lines.append("free(moments);")
        return [*lines, "free(rows);"] if given.input_maps or given.output_maps else lines

    def copy_output(self, column: str, count: int | None) -> list[str]:
        first = "" if count is None else f" && k < {count}"
        return [f"for (size_t k = 0; k < r->samples{first}; ++k) y[k] = {column}[k];"]

    def read_signal(self, function: str, source: Symbol, arguments: Sequence[str]) -> str:
        name = self.code.identifiers[source.name]
        return f"{function}({', '.join([f'signal_{name}', 'p', 'r', 'step', *arguments])})"

    def wrap_signals(self, sources: Iterable[Symbol]) -> str:
        found = []
        for source in sources:
            value = self.read(source)
            unused = "".join(f"{line}\n    " for line in self.begin([value], "p"))
            name = self.code.identifiers[source.name]
            found.append(SIGNAL.format(name=name, unused=unused, value=value))
        return "".join(found)

    def list_weights(self, weights: Sequence[Sequence[float]]) -> str:
        rows = [f"{{{', '.join(map(repr, row))}}}," for row in weights]
        lines = [
            line
            for row in rows
            for line in textwrap.wrap(row, 108, initial_indent=" " * 8, subsequent_indent=" " * 9)
        ]
        return "\n".join([*lines, "    "])


def _list_members(members: Sequence[tuple[str, str, str]]) -> str:
    return "\n".join(
        f"    double {name};{f' /* {comment} */' if comment else ''}" for name, _, comment in members
    )


def _list_values(members: Sequence[tuple[str, str, str]]) -> str:
    return "\n".join(
        f"    .{name} = {value},{f' /* {comment} */' if comment else ''}" for name, value, comment in members
    )
