/* Instance of an FMU around a NARX model, for FMI 2.0 and 3.0. model.h defines the model. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

/* Value references: time, outputs, inputs, start values of the state. */
enum { TIME = 0, OUTPUT = 1, INPUT = OUTPUT + OUTPUTS, START = INPUT + INPUTS, VARIABLES = START + STATES };

/* Phases of an instance. Start values can be set until the simulation runs. */
typedef enum { PREPARING, INITIALISING, RUNNING, TERMINATED, FAILED } Phase;

/* Everything that a simulation changes: a copy of it is the FMU state. */
typedef struct {
    double values[VARIABLES];
    double state[STATES];
    Phase phase;
} Model;

/* Return the state in which an instance begins. */
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
