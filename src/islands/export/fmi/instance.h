/*
 * Instance of an FMU around a NARX model: all that FMI 2.0 and 3.0 have in common. model.h defines the model.
 * The file of an interface defines Log, the type of its function for messages, before it includes this file,
 * and log_error().
 */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

/* Value references: time, outputs, inputs, start values of the state. */
enum { TIME = 0, OUTPUT = 1, INPUT = OUTPUT + OUTPUTS, START = INPUT + INPUTS, VARIABLES = START + STATES };

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;

/* Phases of an instance. Start values can be set until the simulation runs. */
typedef enum { PREPARING, INITIALISING, RUNNING, TERMINATED, FAILED } Phase;

/* Everything that a simulation changes: a copy of it is the FMU state. */
typedef struct {
    double values[VARIABLES];
    double state[STATES];
    Phase phase;
} Model;

typedef struct {
    Model model;
    Log log;
    void *environment;
    char name[256];
} Instance;

/* Pass a message to the function for messages of an instance, which is not NULL. */
static void log_error(const Instance *instance, const char *message);

/* Return a model to the state in which an instance begins. */
static void reset(Model *model)
{
    memset(model, 0, sizeof *model);
    memcpy(model->values + START, START_VALUES, sizeof START_VALUES);
    model->phase = PREPARING;
}

/* Compute the outputs before the first step from the start values. */
static void initialise(Model *model)
{
    memcpy(model->state, model->values + START, sizeof model->state);
    if (FEEDTHROUGH) {
        const double *state = model->state;
        for (int place = 0; place < OUTPUTS; ++place) {
            model->values[OUTPUT + place] = state[0];
            state += DEPTHS[place];
        }
    } else {
        compute(model->state, model->values + INPUT, model->values + OUTPUT);
    }
}

/*
 * Take one step with constant inputs. Without direct feedthrough the outputs are those of the new sample.
 * With it, those of the new sample would need inputs that are not yet known, and they are those of the previous
 * one.
 */
static void take_step(Model *model)
{
    double *inputs = model->values + INPUT, *outputs = model->values + OUTPUT;
    if (FEEDTHROUGH) {
        compute(model->state, inputs, outputs);
        advance(model->state, outputs, inputs);
    } else {
        advance(model->state, outputs, inputs);
        compute(model->state, inputs, outputs);
    }
}

/* Return the number of sampling times in a communication step, or 0 if it is not a multiple. */
static long count_steps(double duration)
{
    double steps = floor(duration / STEP + 0.5);
    return steps >= 1.0 && steps < 1e9 && fabs(duration - steps * STEP) <= 1e-6 * STEP ? (long)steps : 0;
}

/* Simulate a communication step; return a message after a failure, otherwise NULL. */
static const char *simulate(Model *model, double time, double duration)
{
    long steps = count_steps(duration);
    if (model->phase != RUNNING) {
        return "a step is possible only between initialisation and termination";
    }
    if (steps == 0) {
        return "the communication step has to be a multiple of the sampling time of the model";
    }
    for (long step = 0; step < steps; ++step) {
        take_step(model);
    }
    model->values[TIME] = time + duration;
    for (int place = 0; place < OUTPUTS; ++place) {
        if (!isfinite(model->values[OUTPUT + place])) {
            model->phase = FAILED;
            return "an output is not finite: the model has diverged, or an input is not finite";
        }
    }
    return NULL;
}

/* Read variables; return a message after a failure, otherwise NULL. */
static const char *get_values(Model *model, const unsigned *references, size_t count, double *values)
{
    if (model->phase == PREPARING || model->phase == INITIALISING) {
        initialise(model);
    }
    for (size_t place = 0; place < count; ++place) {
        if (references[place] >= VARIABLES) {
            return "there is no variable with this value reference";
        }
        values[place] = model->values[references[place]];
    }
    return NULL;
}

/* Write inputs and start values; return a message after a failure, otherwise NULL. */
static const char *set_values(Model *model, const unsigned *references, size_t count, const double *values)
{
    for (size_t place = 0; place < count; ++place) {
        if (references[place] < INPUT || references[place] >= VARIABLES) {
            return "only inputs and start values can be set";
        }
        if (references[place] >= START && model->phase != PREPARING && model->phase != INITIALISING) {
            return "start values can be set only before the simulation";
        }
        model->values[references[place]] = values[place];
    }
    return NULL;
}

/* Return a copy of the state of a model, in the memory of `into` if that is not NULL. */
static Model *copy_model(const Model *model, Model *into)
{
    if (into == NULL) {
        into = malloc(sizeof *into);
    }
    if (into != NULL) {
        *into = *model;
    }
    return into;
}

/*
 * Calls of the interfaces, which begin with the instance. They return the status, and log a message after a
 * failure.
 */
static Status report(const Instance *instance, const char *failure)
{
    if (failure != NULL && instance->log != NULL) {
        log_error(instance, failure);
    }
    return failure == NULL ? OK : ERROR;
}

/* Return a new instance, or NULL if the token is that of another model or memory is missing. */
static Instance *make_instance(const char *name, const char *token, Log log, void *environment)
{
    Instance *instance = strcmp(token, TOKEN) == 0 ? calloc(1, sizeof *instance) : NULL;
    if (instance != NULL) {
        reset(&instance->model);
        instance->log = log;
        instance->environment = environment;
        strncpy(instance->name, name, sizeof instance->name - 1);
    }
    return instance;
}

static Status set_phase(Instance *instance, Phase phase)
{
    instance->model.phase = phase;
    return OK;
}

static Status exit_initialisation(Instance *instance)
{
    initialise(&instance->model);
    return set_phase(instance, RUNNING);
}

static Status reset_instance(Instance *instance)
{
    reset(&instance->model);
    return OK;
}

static Status read_variables(Instance *instance, const unsigned *references, size_t count, double *values)
{
    return report(instance, get_values(&instance->model, references, count, values));
}

static Status write_variables(
    Instance *instance, const unsigned *references, size_t count, const double *values)
{
    return report(instance, set_values(&instance->model, references, count, values));
}

static Status do_step(Instance *instance, double time, double duration)
{
    return report(instance, simulate(&instance->model, time, duration));
}

static Status store_state(const Instance *instance, void **state)
{
    *state = copy_model(&instance->model, *state);
    return report(instance, *state == NULL ? "out of memory" : NULL);
}

static Status restore_state(Instance *instance, const void *state)
{
    copy_model(state, &instance->model);
    return OK;
}

static Status free_state(void **state)
{
    free(*state);
    *state = NULL;
    return OK;
}

static Status serialise_state(const Instance *instance, const void *state, void *bytes, size_t size)
{
    if (size >= sizeof(Model)) {
        memcpy(bytes, state, sizeof(Model));
    }
    return report(instance, size < sizeof(Model) ? "the memory for the serialised state is too small" : NULL);
}

static Status deserialise_state(const Instance *instance, const void *bytes, size_t size, void **state)
{
    Model model;
    if (size != sizeof model) {
        return report(instance, "the serialised state has another size");
    }
    memcpy(&model, bytes, sizeof model);
    *state = copy_model(&model, *state);
    return report(instance, *state == NULL ? "out of memory" : NULL);
}
