/* Co-simulation interface of FMI 3.0 for a NARX model: https://fmi-standard.org */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef void (*Log)(void *environment, int status, const char *category, const char *text);

#include "instance.h"

static void log_error(const Instance *instance, const char *message)
{
    instance->log(instance->environment, ERROR, "logStatusError", message);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT Status fmi3SetDebugLogging(void *c, bool on, size_t count, const char *const categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return OK;
}

EXPORT void *fmi3InstantiateCoSimulation(
    const char *name, const char *token, const char *resources, bool visible, bool logging, bool event_mode,
    bool early_return, const uint32_t intermediate[], size_t intermediates, void *environment, Log log,
    void (*update)(void *, double, bool, bool, bool, bool, bool *, double *))
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)early_return, (void)intermediate;
    (void)update;
    return event_mode || intermediates > 0 ? NULL : make_instance("", token, log, environment);
}

EXPORT void fmi3FreeInstance(void *c) { free(c); }

EXPORT Status fmi3EnterInitializationMode(
    void *c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop)
{
    Instance *instance = c;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    instance->model.values[TIME] = start;
    return set_phase(instance, INITIALISING);
}

EXPORT Status fmi3ExitInitializationMode(void *c) { return exit_initialisation(c); }

EXPORT Status fmi3Terminate(void *c) { return set_phase(c, TERMINATED); }

EXPORT Status fmi3Reset(void *c) { return reset_instance(c); }

EXPORT Status fmi3DoStep(
    void *c, double time, double step, bool is_final, bool *needs_event, bool *terminate, bool *is_early,
    double *last_time)
{
    Instance *instance = c;
    Status status = do_step(instance, time, step);
    (void)is_final;
    *needs_event = *terminate = *is_early = false;
    *last_time = instance->model.values[TIME];
    return status;
}

EXPORT Status fmi3GetFloat64(
    void *c, const uint32_t references[], size_t count, double values[], size_t value_count)
{
    (void)value_count;
    return read_variables(c, references, count, values);
}

EXPORT Status fmi3SetFloat64(
    void *c, const uint32_t references[], size_t count, const double values[], size_t value_count)
{
    (void)value_count;
    return write_variables(c, references, count, values);
}

EXPORT Status fmi3GetFMUState(void *c, void **state) { return store_state(c, state); }

EXPORT Status fmi3SetFMUState(void *c, void *state) { return restore_state(c, state); }

EXPORT Status fmi3FreeFMUState(void *c, void **state)
{
    (void)c;
    return free_state(state);
}

EXPORT Status fmi3SerializedFMUStateSize(void *c, void *state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(Model);
    return OK;
}

EXPORT Status fmi3SerializeFMUState(void *c, void *state, uint8_t bytes[], size_t size)
{
    return serialise_state(c, state, bytes, size);
}

EXPORT Status fmi3DeserializeFMUState(void *c, const uint8_t bytes[], size_t size, void **state)
{
    return deserialise_state(c, bytes, size, state);
}

/* The remaining functions of the interface concern what this model does not have. */

#define NO_VARIABLES(name, type)                                                                  \
    EXPORT Status name(                                                                           \
        void *c, const uint32_t references[], size_t count, type values[], size_t value_count)    \
    {                                                                                             \
        (void)references, (void)values, (void)value_count;                                        \
        return report(c, count == 0 ? NULL : "all variables of this model are of type Float64");  \
    }

NO_VARIABLES(fmi3GetFloat32, float)
NO_VARIABLES(fmi3GetInt8, int8_t)
NO_VARIABLES(fmi3GetUInt8, uint8_t)
NO_VARIABLES(fmi3GetInt16, int16_t)
NO_VARIABLES(fmi3GetUInt16, uint16_t)
NO_VARIABLES(fmi3GetInt32, int32_t)
NO_VARIABLES(fmi3GetUInt32, uint32_t)
NO_VARIABLES(fmi3GetInt64, int64_t)
NO_VARIABLES(fmi3GetUInt64, uint64_t)
NO_VARIABLES(fmi3GetBoolean, bool)
NO_VARIABLES(fmi3GetString, const char *)
NO_VARIABLES(fmi3SetFloat32, const float)
NO_VARIABLES(fmi3SetInt8, const int8_t)
NO_VARIABLES(fmi3SetUInt8, const uint8_t)
NO_VARIABLES(fmi3SetInt16, const int16_t)
NO_VARIABLES(fmi3SetUInt16, const uint16_t)
NO_VARIABLES(fmi3SetInt32, const int32_t)
NO_VARIABLES(fmi3SetUInt32, const uint32_t)
NO_VARIABLES(fmi3SetInt64, const int64_t)
NO_VARIABLES(fmi3SetUInt64, const uint64_t)
NO_VARIABLES(fmi3SetBoolean, const bool)
NO_VARIABLES(fmi3SetString, const char *const)

#define ABSENT(name, arguments)                                                                   \
    EXPORT Status name arguments                                                                  \
    {                                                                                             \
        return report(c, "the model does not have what " #name " is for");                        \
    }

#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

ABSENT(fmi3GetBinary, (void *c, const uint32_t r[], size_t n, size_t s[], const uint8_t *v[], size_t m))
ABSENT(fmi3SetBinary,
       (void *c, const uint32_t r[], size_t n, const size_t s[], const uint8_t *const v[], size_t m))
ABSENT(fmi3GetClock, (void *c, const uint32_t r[], size_t n, bool v[]))
ABSENT(fmi3SetClock, (void *c, const uint32_t r[], size_t n, const bool v[]))
ABSENT(fmi3GetNumberOfVariableDependencies, (void *c, uint32_t r, size_t *n))
ABSENT(fmi3GetVariableDependencies,
       (void *c, uint32_t r, size_t e[], uint32_t i[], size_t j[], int kinds[], size_t n))
ABSENT(fmi3GetDirectionalDerivative,
       (void *c, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk, const double seed[],
        size_t ns, double d[], size_t nd))
ABSENT(fmi3GetAdjointDerivative,
       (void *c, const uint32_t u[], size_t nu, const uint32_t k[], size_t nk, const double seed[],
        size_t ns, double d[], size_t nd))
ABSENT(fmi3EnterConfigurationMode, (void *c))
ABSENT(fmi3ExitConfigurationMode, (void *c))
ABSENT(fmi3GetIntervalDecimal, (void *c, const uint32_t r[], size_t n, double i[], int q[]))
ABSENT(fmi3GetIntervalFraction,
       (void *c, const uint32_t r[], size_t n, uint64_t i[], uint64_t s[], int q[]))
ABSENT(fmi3GetShiftDecimal, (void *c, const uint32_t r[], size_t n, double s[]))
ABSENT(fmi3GetShiftFraction, (void *c, const uint32_t r[], size_t n, uint64_t i[], uint64_t s[]))
ABSENT(fmi3SetIntervalDecimal, (void *c, const uint32_t r[], size_t n, const double i[]))
ABSENT(fmi3SetIntervalFraction,
       (void *c, const uint32_t r[], size_t n, const uint64_t i[], const uint64_t s[]))
ABSENT(fmi3SetShiftDecimal, (void *c, const uint32_t r[], size_t n, const double s[]))
ABSENT(fmi3SetShiftFraction,
       (void *c, const uint32_t r[], size_t n, const uint64_t i[], const uint64_t s[]))
ABSENT(fmi3EvaluateDiscreteStates, (void *c))
ABSENT(fmi3UpdateDiscreteStates,
       (void *c, bool *update, bool *terminate, bool *nominals, bool *values, bool *has_next, double *next))
ABSENT(fmi3EnterEventMode, (void *c))
ABSENT(fmi3EnterStepMode, (void *c))
ABSENT(fmi3GetOutputDerivatives,
       (void *c, const uint32_t r[], size_t n, const int32_t o[], double v[], size_t m))

/* Importers load the functions of the other interfaces as well. */

EXPORT void *fmi3InstantiateModelExchange(
    const char *name, const char *token, const char *resources, bool visible, bool logging, void *environment,
    Log log)
{
    return NULL;
}

EXPORT void *fmi3InstantiateScheduledExecution(
    const char *name, const char *token, const char *resources, bool visible, bool logging, void *environment,
    Log log, void (*update)(void *), void (*lock)(void), void (*unlock)(void))
{
    return NULL;
}

ABSENT(fmi3ActivateModelPartition, (void *c, uint32_t clock, double time))
ABSENT(fmi3EnterContinuousTimeMode, (void *c))
ABSENT(fmi3CompletedIntegratorStep, (void *c, bool is_final, bool *enter, bool *terminate))
ABSENT(fmi3SetTime, (void *c, double time))
ABSENT(fmi3SetContinuousStates, (void *c, const double x[], size_t n))
ABSENT(fmi3GetContinuousStates, (void *c, double x[], size_t n))
ABSENT(fmi3GetContinuousStateDerivatives, (void *c, double x[], size_t n))
ABSENT(fmi3GetNominalsOfContinuousStates, (void *c, double x[], size_t n))
ABSENT(fmi3GetNumberOfContinuousStates, (void *c, size_t *n))
ABSENT(fmi3GetEventIndicators, (void *c, double z[], size_t n))
ABSENT(fmi3GetNumberOfEventIndicators, (void *c, size_t *n))
