/*
 * Reference FMU of the tests: m x'' + c x' + k x = u + w, a mass between an input, a disturbance and a stop.
 *
 * FMI is 2 or 3. At x = stop the mass rebounds with half its velocity (a state event), and at the time `on` a
 * constant force of 1 acts (a time event). A mass that is not positive is an error, one above 1e6 is fatal.
 * Functions that no test calls are in unused.h, because a loader requires all of them.
 */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#ifdef ATTACK
#include "attacks.h"
#endif

#include "unused.h"

#if FMI == 2
#include "fmi2FunctionTypes.h"
#define NAME(name) fmi2##name
typedef fmi2Status Status;
typedef fmi2ValueReference Reference;
typedef fmi2Boolean Boolean;
#define OK fmi2OK
#define ERROR fmi2Error
#define FATAL fmi2Fatal
#define API
#else
#include "fmi3FunctionTypes.h"
#define NAME(name) fmi3##name
typedef fmi3Status Status;
typedef fmi3ValueReference Reference;
typedef fmi3Boolean Boolean;
#define OK fmi3OK
#define ERROR fmi3Error
#define FATAL fmi3Fatal
#define API
#endif

enum { TIME, U, X, V, DX, DV, M, C, K, W, STOP, ON, VARIABLES };

typedef struct {
    double values[VARIABLES];
    int is_on;
    int is_exchange;
#if FMI == 2
    fmi2CallbackFunctions callbacks;
#else
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
#endif
} Mass;

static void start(Mass *mass)
{
    memset(mass->values, 0, sizeof mass->values);
    mass->values[M] = 0.5;
    mass->values[C] = 4.0;
    mass->values[K] = 200.0;
    mass->values[STOP] = 1e9;
    mass->values[ON] = 1e9;
    mass->is_on = 0;
}

static Status fail(Mass *mass)
{
    Status status = mass->values[M] > 1e6 ? FATAL : ERROR;
#if FMI == 2
    mass->callbacks.logger(mass->callbacks.componentEnvironment, "mass", status, "error", "m is out of range");
#else
    if (mass->log) mass->log(mass->environment, status, "error", "m is out of range");
#endif
    return status;
}

static bool is_valid(const Mass *mass) { return mass->values[M] > 0.0 && mass->values[M] <= 1e6; }

static void derive(Mass *mass)
{
    double *q = mass->values;
    q[DX] = q[V];
    q[DV] = (q[U] + q[W] + mass->is_on - q[C] * q[V] - q[K] * q[X]) / q[M];
}

static void handle_events(Mass *mass)
{
    double *q = mass->values;
    if (q[TIME] >= q[ON] - 1e-9) mass->is_on = 1;
    if (q[X] > q[STOP] && q[V] > 0.0) {
        q[X] = q[STOP];
        q[V] *= -0.5;
    }
}

static void advance(Mass *mass, double duration)
{
    double *q = mass->values, before = q[TIME], h = duration / 16;
    for (int step = 0; step < 16; ++step) {
        double x = q[X], v = q[V], sum_x = 0.0, sum_v = 0.0;
        static const double weights[] = {1, 2, 2, 1}, parts[] = {0.5, 0.5, 1};
        for (int stage = 0; stage < 4; ++stage) {
            derive(mass);
            sum_x += weights[stage] * q[DX];
            sum_v += weights[stage] * q[DV];
            if (stage < 3) {
                q[X] = x + parts[stage] * h * q[DX];
                q[V] = v + parts[stage] * h * q[DV];
            }
        }
        q[X] = x + h / 6 * sum_x;
        q[V] = v + h / 6 * sum_v;
        q[TIME] = before + (step + 1) * h;
        handle_events(mass);
    }
}

#if FMI == 2
API const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
API const char *fmi2GetVersion(void) { return "2.0"; }
API fmi2Component fmi2Instantiate(fmi2String name, fmi2Type kind, fmi2String guid, fmi2String resources,
                                  const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    Mass *mass = calloc(1, sizeof *mass);
    start(mass);
    mass->callbacks = *callbacks;
    mass->is_exchange = kind == fmi2ModelExchange;
    return strcmp(guid, "mass") ? NULL : mass;
}
API Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, double tolerance, double begin,
                               fmi2Boolean has_stop, double stop)
{
    ((Mass *)c)->values[TIME] = begin;
    return OK;
}
API Status fmi2EnterInitializationMode(fmi2Component c) { return is_valid(c) ? OK : fail(c); }
API Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info)
{
    Mass *mass = c;
    handle_events(mass);
    info->newDiscreteStatesNeeded = info->terminateSimulation = info->nominalsOfContinuousStatesChanged = 0;
    info->valuesOfContinuousStatesChanged = 1;
    info->nextEventTimeDefined = !mass->is_on;
    info->nextEventTime = mass->values[ON];
    return OK;
}
API Status fmi2DoStep(fmi2Component c, double time, double step, fmi2Boolean keep)
{
    advance(c, step);
    return OK;
}
#else
API const char *fmi3GetVersion(void) { return "3.0"; }
static void *make(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, int is_exchange)
{
#ifdef ATTACK
    log(environment, ERROR, "error", attack());
    return NULL;
#endif
    Mass *mass = calloc(1, sizeof *mass);
    start(mass);
    mass->environment = environment;
    mass->log = log;
    mass->is_exchange = is_exchange;
    return mass;
}
API fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                              bool logging, fmi3InstanceEnvironment environment,
                                              fmi3LogMessageCallback log)
{
    return make(environment, log, 1);
}
API fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible,
                                             bool logging, bool event_mode, bool early,
                                             const fmi3ValueReference references[], size_t count,
                                             fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                             fmi3IntermediateUpdateCallback update)
{
    return make(environment, log, 0);
}
API Status fmi3EnterInitializationMode(fmi3Instance c, bool has_tolerance, double tolerance, double begin,
                                       bool has_stop, double stop)
{
    ((Mass *)c)->values[TIME] = begin;
    return is_valid(c) ? OK : fail(c);
}
API Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *needed, bool *terminate, bool *nominals, bool *values,
                                    bool *has_time, double *next)
{
    Mass *mass = c;
    handle_events(mass);
    *needed = *terminate = *nominals = false;
    *values = true;
    *has_time = !mass->is_on;
    *next = mass->values[ON];
    return OK;
}
API Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count) { return *count = 1, OK; }
API Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count) { return *count = 2, OK; }
API Status fmi3DoStep(fmi3Instance c, double time, double step, bool keep, bool *event, bool *terminate, bool *early,
                      double *last)
{
    advance(c, step);
    *event = *terminate = *early = false;
    *last = time + step;
    return OK;
}
#endif

API void NAME(FreeInstance)(void *c) { free(c); }
API Status NAME(ExitInitializationMode)(void *c) { return OK; }
API Status NAME(EnterEventMode)(void *c) { return OK; }
API Status NAME(EnterContinuousTimeMode)(void *c) { return OK; }
API Status NAME(Terminate)(void *c) { return OK; }
API Status NAME(SetTime)(void *c, double time) { return ((Mass *)c)->values[TIME] = time, OK; }

API Status NAME(Reset)(void *c)
{
#ifdef NO_RESET
    return ERROR;
#else
    start(c);
    return OK;
#endif
}

API Status NAME(SetContinuousStates)(void *c, const double x[], size_t count)
{
    memcpy(((Mass *)c)->values + X, x, count * sizeof *x);
    return OK;
}

API Status NAME(GetContinuousStates)(void *c, double x[], size_t count)
{
    memcpy(x, ((Mass *)c)->values + X, count * sizeof *x);
    return OK;
}

static Status get_derivatives(Mass *mass, double dx[], size_t count)
{
    derive(mass);
    memcpy(dx, mass->values + DX, count * sizeof *dx);
    return OK;
}

API Status NAME(GetEventIndicators)(void *c, double z[], size_t count)
{
    z[0] = ((Mass *)c)->values[X] - ((Mass *)c)->values[STOP];
    return OK;
}

static Status get_values(Mass *mass, const Reference references[], size_t count, double values[])
{
    derive(mass);
    for (size_t place = 0; place < count; ++place) values[place] = mass->values[references[place]];
    return OK;
}

static Status set_values(Mass *mass, const Reference references[], size_t count, const double values[])
{
    for (size_t place = 0; place < count; ++place) mass->values[references[place]] = values[place];
    return OK;
}

#if FMI == 2
API Status fmi2GetDerivatives(void *c, double dx[], size_t count) { return get_derivatives(c, dx, count); }
API Status fmi2GetReal(void *c, const Reference r[], size_t n, double v[]) { return get_values(c, r, n, v); }
API Status fmi2SetReal(void *c, const Reference r[], size_t n, const double v[]) { return set_values(c, r, n, v); }
API Status fmi2CompletedIntegratorStep(void *c, Boolean keep, Boolean *event, Boolean *terminate)
{
    *event = *terminate = 0;
    return OK;
}
#else
API Status fmi3GetContinuousStateDerivatives(void *c, double dx[], size_t n) { return get_derivatives(c, dx, n); }
API Status fmi3GetFloat64(void *c, const Reference r[], size_t n, double v[], size_t m)
{
    return get_values(c, r, n, v);
}
API Status fmi3SetFloat64(void *c, const Reference r[], size_t n, const double v[], size_t m)
{
    return set_values(c, r, n, v);
}
API Status fmi3CompletedIntegratorStep(void *c, Boolean keep, Boolean *event, Boolean *terminate)
{
    *event = *terminate = false;
    return OK;
}
#endif
