/* Co-simulation interface of FMI 2.0 for a NARX model: https://fmi-standard.org */

#include <stddef.h>

typedef void (*Log)(
    void *environment, const char *name, int status, const char *category, const char *text, ...);

#include "instance.h"

typedef enum { DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED_STATUS } StatusKind;
typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Kind;

typedef struct {
    Log log;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, Status status);
    void *environment;
} Callbacks;

static void log_error(const Instance *instance, const char *message)
{
    instance->log(instance->environment, instance->name, ERROR, "logStatusError", "%s", message);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT Status fmi2SetDebugLogging(void *c, int on, size_t count, const char *const categories[])
{
    (void)c, (void)on, (void)count, (void)categories;
    return OK;
}

EXPORT void *fmi2Instantiate(
    const char *name, Kind kind, const char *guid, const char *resources, const Callbacks *callbacks,
    int visible, int logging)
{
    const Callbacks none = {0}, *given = callbacks == NULL ? &none : callbacks;
    (void)resources, (void)visible, (void)logging;
    return kind == CO_SIMULATION ? make_instance(name, guid, given->log, given->environment) : NULL;
}

EXPORT void fmi2FreeInstance(void *c) { free(c); }

EXPORT Status fmi2SetupExperiment(
    void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    Instance *instance = c;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    instance->model.values[TIME] = start;
    return OK;
}

EXPORT Status fmi2EnterInitializationMode(void *c) { return set_phase(c, INITIALISING); }

EXPORT Status fmi2ExitInitializationMode(void *c) { return exit_initialisation(c); }

EXPORT Status fmi2Terminate(void *c) { return set_phase(c, TERMINATED); }

EXPORT Status fmi2Reset(void *c) { return reset_instance(c); }

EXPORT Status fmi2GetReal(void *c, const unsigned references[], size_t count, double values[])
{
    return read_variables(c, references, count, values);
}

EXPORT Status fmi2SetReal(void *c, const unsigned references[], size_t count, const double values[])
{
    return write_variables(c, references, count, values);
}

/* All variables are real. */
#define NO_VARIABLES(name, type)                                                                  \
    EXPORT Status name(void *c, const unsigned references[], size_t count, type values[])         \
    {                                                                                             \
        (void)references, (void)values;                                                           \
        return report(c, count == 0 ? NULL : "all variables of this model are of type Real");     \
    }

NO_VARIABLES(fmi2GetInteger, int)
NO_VARIABLES(fmi2GetBoolean, int)
NO_VARIABLES(fmi2GetString, const char *)
NO_VARIABLES(fmi2SetInteger, const int)
NO_VARIABLES(fmi2SetBoolean, const int)
NO_VARIABLES(fmi2SetString, const char *const)

EXPORT Status fmi2DoStep(void *c, double time, double step, int is_final)
{
    (void)is_final;
    return do_step(c, time, step);
}

EXPORT Status fmi2CancelStep(void *c) { return report(c, "a step cannot be cancelled"); }

EXPORT Status fmi2GetFMUstate(void *c, void **state) { return store_state(c, state); }

EXPORT Status fmi2SetFMUstate(void *c, void *state) { return restore_state(c, state); }

EXPORT Status fmi2FreeFMUstate(void *c, void **state)
{
    (void)c;
    return free_state(state);
}

EXPORT Status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(Model);
    return OK;
}

EXPORT Status fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size)
{
    return serialise_state(c, state, bytes, size);
}

EXPORT Status fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state)
{
    return deserialise_state(c, bytes, size, state);
}

EXPORT Status fmi2GetDirectionalDerivative(
    void *c, const unsigned unknowns[], size_t rows, const unsigned knowns[], size_t columns,
    const double seed[], double derivative[])
{
    (void)unknowns, (void)rows, (void)knowns, (void)columns, (void)seed, (void)derivative;
    return report(c, "the model has no directional derivatives");
}

EXPORT Status fmi2SetRealInputDerivatives(
    void *c, const unsigned references[], size_t count, const int orders[], const double values[])
{
    (void)references, (void)orders, (void)values;
    return report(c, count == 0 ? NULL : "inputs are constant between samples");
}

EXPORT Status fmi2GetRealOutputDerivatives(
    void *c, const unsigned references[], size_t count, const int orders[], double values[])
{
    (void)references, (void)orders, (void)values;
    return report(c, count == 0 ? NULL : "the output is constant between samples");
}

EXPORT Status fmi2GetRealStatus(void *c, StatusKind kind, double *value)
{
    const Instance *instance = c;
    *value = instance->model.values[TIME];
    return kind == LAST_SUCCESSFUL_TIME ? OK : DISCARD;
}

EXPORT Status fmi2GetBooleanStatus(void *c, StatusKind kind, int *value)
{
    (void)c;
    *value = 0;
    return kind == TERMINATED_STATUS ? OK : DISCARD;
}

/* Steps are synchronous: there is no pending status. */
#define NO_STATUS(name, type)                                                                     \
    EXPORT Status name(void *c, StatusKind kind, type *value)                                     \
    {                                                                                             \
        (void)c, (void)kind, (void)value;                                                         \
        return DISCARD;                                                                           \
    }

NO_STATUS(fmi2GetStatus, Status)
NO_STATUS(fmi2GetIntegerStatus, int)
NO_STATUS(fmi2GetStringStatus, const char *)
