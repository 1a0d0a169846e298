/* Co-simulation interface of FMI 2.0 for a NARX model: https://fmi-standard.org */

#include "instance.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef enum { DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED_STATUS } StatusKind;
typedef enum { MODEL_EXCHANGE, CO_SIMULATION } Kind;

typedef struct {
    void (*log)(void *environment, const char *name, Status status, const char *category, const char *text, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, Status status);
    void *environment;
} Callbacks;

typedef struct {
    Model model;
    Callbacks callbacks;
    char name[256];
} Instance;

/* Return the status of a call, and log its message after a failure. */
static Status report(const Instance *instance, const char *failure)
{
    if (failure != NULL && instance->callbacks.log != NULL) {
        instance->callbacks.log(
            instance->callbacks.environment, instance->name, ERROR, "logStatusError", "%s", failure);
    }
    return failure == NULL ? OK : ERROR;
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
    Instance *instance;
    (void)resources, (void)visible, (void)logging;
    if (kind != CO_SIMULATION || strcmp(guid, TOKEN) != 0) {
        return NULL;
    }
    instance = calloc(1, sizeof *instance);
    if (instance != NULL) {
        reset(&instance->model);
        if (callbacks != NULL) {
            instance->callbacks = *callbacks;
        }
        strncpy(instance->name, name, sizeof instance->name - 1);
    }
    return instance;
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

EXPORT Status fmi2EnterInitializationMode(void *c)
{
    Instance *instance = c;
    instance->model.phase = INITIALISING;
    return OK;
}

EXPORT Status fmi2ExitInitializationMode(void *c)
{
    Instance *instance = c;
    initialise(&instance->model);
    instance->model.phase = RUNNING;
    return OK;
}

EXPORT Status fmi2Terminate(void *c)
{
    Instance *instance = c;
    instance->model.phase = TERMINATED;
    return OK;
}

EXPORT Status fmi2Reset(void *c)
{
    Instance *instance = c;
    reset(&instance->model);
    return OK;
}

EXPORT Status fmi2GetReal(void *c, const unsigned references[], size_t count, double values[])
{
    Instance *instance = c;
    return report(instance, get_values(&instance->model, references, count, values));
}

EXPORT Status fmi2SetReal(void *c, const unsigned references[], size_t count, const double values[])
{
    Instance *instance = c;
    return report(instance, set_values(&instance->model, references, count, values));
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
    Instance *instance = c;
    (void)is_final;
    return report(instance, simulate(&instance->model, time, step));
}

EXPORT Status fmi2CancelStep(void *c) { return report(c, "a step cannot be cancelled"); }

EXPORT Status fmi2GetFMUstate(void *c, void **state)
{
    Instance *instance = c;
    *state = copy_model(&instance->model, *state);
    return report(instance, *state == NULL ? "out of memory" : NULL);
}

EXPORT Status fmi2SetFMUstate(void *c, void *state)
{
    Instance *instance = c;
    copy_model(state, &instance->model);
    return OK;
}

EXPORT Status fmi2FreeFMUstate(void *c, void **state)
{
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT Status fmi2SerializedFMUstateSize(void *c, void *state, size_t *size)
{
    (void)c, (void)state;
    *size = sizeof(Model);
    return OK;
}

EXPORT Status fmi2SerializeFMUstate(void *c, void *state, char bytes[], size_t size)
{
    if (size < sizeof(Model)) {
        return report(c, "the memory for the serialised state is too small");
    }
    memcpy(bytes, state, sizeof(Model));
    return OK;
}

EXPORT Status fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **state)
{
    Model model;
    if (size != sizeof model) {
        return report(c, "the serialised state has another size");
    }
    memcpy(&model, bytes, sizeof model);
    *state = copy_model(&model, *state);
    return report(c, *state == NULL ? "out of memory" : NULL);
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
