"""Operators of maps as C functions; see `islands.effects.interface.map_equation.OPERATORS`.

Each function writes its result for the signal ``x`` to ``z``, or returns a number.
"""

from collections.abc import Mapping
from types import MappingProxyType

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
