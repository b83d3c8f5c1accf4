/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* The functions of FMI 3.0, model exchange and co-simulation. */
#include "fmi3Functions.h"
#include "instance.h"

#include <stdlib.h>
#include <string.h>

/* After initialization, in one of the two kinds of simulation; where states have values; at any time. */
enum { EXCHANGING = EVENTS | CONTINUOUS, RUNNING = EXCHANGING | STEPPING,
       EVALUATED = INITIALIZATION | EXCHANGING | TERMINATED, STARTING = INSTANTIATED | INITIALIZATION,
       ANY = STARTING | RUNNING | TERMINATED };

#define STATUS(right) ((right) ? fmi3OK : fmi3Error)
#define MAY(modes) instance_may(c, __func__, (modes))
#define REFUSE_UNLESS(modes) do { if (!MAY(modes)) { return fmi3Error; } } while (0)

/* The function of the importer for messages, which C does not let stand in memory for data by itself. */
typedef struct {
    fmi3LogMessageCallback log;
} Logger;

static void log_error(const Instance *instance, const char *message) {
    const Logger *logger = instance->logger;
    if (logger->log) {
        logger->log(instance->environment, fmi3Error, "logStatusError", message);
    }
}

/* What this model has not, which is an error to ask for. */
static fmi3Status none(fmi3Instance c, const char *function, const char *wrong) {
    return STATUS(instance_may(c, function, ANY) && instance_said(c, function, wrong));
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[]) {
    (void)on;
    return STATUS(MAY(ANY) && instance_has(c, __func__, count, categories, categories));
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    Logger logger = {log};
    (void)resources;
    (void)visible;
    (void)logging;
    return instance_new(name, token, 0, environment, log_error, &logger, sizeof logger);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference between[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Logger logger = {log};
    Instance *instance = instance_new(name, token, 1, environment, log_error, &logger, sizeof logger);
    (void)resources;
    (void)visible;
    (void)logging;
    (void)early;
    (void)between;
    (void)count;
    (void)update;
    if (instance && events) {
        instance_said(instance, __func__, "this model has no event mode for co-simulation");
        instance_free(instance);
        return 0;
    }
    return instance;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)update;
    (void)lock;
    (void)unlock;
    if (log) {
        log(environment, fmi3Error, "logStatusError", "this model has no scheduled execution");
    }
    return 0;
}

void fmi3FreeInstance(fmi3Instance c) { instance_free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerated, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean bounded, fmi3Float64 stop) {
    (void)tolerated;
    (void)tolerance;
    if (!MAY(INSTANTIATED) || !instance_start(c, __func__, start, bounded, stop)) {
        return fmi3Error;
    }
    ((Instance *)c)->model.values.mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    Instance *instance = c;
    REFUSE_UNLESS(INITIALIZATION);
    model_initialise(&instance->model, instance->stepped ? STEPPING : EVENTS);
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    REFUSE_UNLESS(EXCHANGING);
    ((Instance *)c)->model.values.mode = EVENTS;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
    REFUSE_UNLESS(RUNNING);
    ((Instance *)c)->model.values.mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
    REFUSE_UNLESS(ANY);
    model_reset(&((Instance *)c)->model);
    return fmi3OK;
}

/* A message unless there are as many values as variables. */
static int as_many(fmi3Instance c, const char *function, size_t count, size_t values) {
    return instance_said(c, function, count == values ? 0 : "there are not as many values as variables");
}

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t size) {
    return STATUS(MAY(ANY) && as_many(c, __func__, count, size) &&
                  instance_has(c, __func__, count, references, values) &&
                  instance_get(c, __func__, references, count, values));
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t size) {
    return STATUS(MAY(ANY) && as_many(c, __func__, count, size) &&
                  instance_has(c, __func__, count, references, values) &&
                  instance_set(c, __func__, references, count, values));
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Int32 values[],
                        size_t size) {
    size_t at;
    if (!MAY(ANY) || !as_many(c, __func__, count, size) || !instance_has(c, __func__, count, references, values)) {
        return fmi3Error;
    }
    for (at = 0; at < count; at++) {
        int found;
        if (!instance_said_of(c, __func__, references[at],
                              model_get_integer(&((Instance *)c)->model, references[at], &found))) {
            return fmi3Error;
        }
        values[at] = found;
    }
    return fmi3OK;
}

fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                        const fmi3Int32 values[], size_t size) {
    size_t at;
    if (!MAY(ANY) || !as_many(c, __func__, count, size) || !instance_has(c, __func__, count, references, values)) {
        return fmi3Error;
    }
    for (at = 0; at < count; at++) {
        Model *model = &((Instance *)c)->model;
        const char *wrong = model_set_integer(model, references[at], values[at]);
        if (!instance_said_of(c, __func__, references[at], wrong)) {
            return fmi3Error;
        }
    }
    return fmi3OK;
}

/* There are no variables of these types. */
static fmi3Status none_of(fmi3Instance c, const char *function, size_t count) {
    return none(c, function, count ? "this model has no variable of this type" : 0);
}

#define NO_VARIABLES(type)                                                                                            \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference references[], size_t count,                     \
                             fmi3##type values[], size_t size) {                                                      \
        (void)references;                                                                                             \
        (void)values;                                                                                                 \
        (void)size;                                                                                                   \
        return none_of(c, __func__, count);                                                                           \
    }                                                                                                                 \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference references[], size_t count,                     \
                             const fmi3##type values[], size_t size) {                                                \
        (void)references;                                                                                             \
        (void)values;                                                                                                 \
        (void)size;                                                                                                   \
        return none_of(c, __func__, count);                                                                           \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t count, size_t sizes[],
                         fmi3Binary values[], size_t size) {
    (void)references;
    (void)sizes;
    (void)values;
    (void)size;
    return none_of(c, __func__, count);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference references[], size_t count, const size_t sizes[],
                         const fmi3Binary values[], size_t size) {
    (void)references;
    (void)sizes;
    (void)values;
    (void)size;
    return none_of(c, __func__, count);
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Clock values[]) {
    (void)references;
    (void)values;
    return none_of(c, __func__, count);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference references[], size_t count, const fmi3Clock values[]) {
    (void)references;
    (void)values;
    return none_of(c, __func__, count);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference reference, size_t *count) {
    (void)reference;
    (void)count;
    return none(c, __func__, "the dependencies are those of the model description");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t others[], fmi3DependencyKind kinds[],
                                       size_t count) {
    (void)dependent;
    (void)elements;
    (void)independents;
    (void)others;
    (void)kinds;
    (void)count;
    return none(c, __func__, "the dependencies are those of the model description");
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
    return STATUS(MAY(ANY) && instance_save(c, __func__, state));
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
    return STATUS(MAY(ANY) && instance_restore(c, __func__, state));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
    REFUSE_UNLESS(ANY);
    if (state) {
        free(*state);
        *state = 0;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    if (!MAY(ANY) || !instance_has(c, __func__, 1, state, size)) {
        return fmi3Error;
    }
    *size = sizeof(Saved);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return STATUS(MAY(ANY) && instance_serialise(c, __func__, state, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return STATUS(MAY(ANY) && instance_deserialise(c, __func__, bytes, size, state));
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t count,
                                        const fmi3ValueReference knowns[], size_t known, const fmi3Float64 seed[],
                                        size_t seeds, fmi3Float64 changes[], size_t size) {
    return STATUS(MAY(ANY) && as_many(c, __func__, count, size) && as_many(c, __func__, known, seeds) &&
                  instance_change(c, __func__, unknowns, count, knowns, known, seed, changes));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance c, const fmi3ValueReference unknowns[], size_t count,
                                    const fmi3ValueReference knowns[], size_t known, const fmi3Float64 seed[],
                                    size_t seeds, fmi3Float64 changes[], size_t size) {
    (void)unknowns;
    (void)count;
    (void)knowns;
    (void)known;
    (void)seed;
    (void)seeds;
    (void)changes;
    (void)size;
    return none(c, __func__, "there are directional derivatives, not adjoint ones");
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    return none(c, __func__, "this model has nothing to configure");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    return none(c, __func__, "this model has nothing to configure");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                  fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]) {
    (void)references;
    (void)intervals;
    (void)qualifiers;
    return none_of(c, __func__, count);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                   fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[]) {
    (void)references;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return none_of(c, __func__, count);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                               fmi3Float64 shifts[]) {
    (void)references;
    (void)shifts;
    return none_of(c, __func__, count);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                fmi3UInt64 counters[], fmi3UInt64 resolutions[]) {
    (void)references;
    (void)counters;
    (void)resolutions;
    return none_of(c, __func__, count);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                  const fmi3Float64 intervals[]) {
    (void)references;
    (void)intervals;
    return none_of(c, __func__, count);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                   const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)references;
    (void)counters;
    (void)resolutions;
    return none_of(c, __func__, count);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                               const fmi3Float64 shifts[]) {
    (void)references;
    (void)shifts;
    return none_of(c, __func__, count);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)references;
    (void)counters;
    (void)resolutions;
    return none_of(c, __func__, count);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c) { return STATUS(MAY(INITIALIZATION | EVENTS)); }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *update, fmi3Boolean *end, fmi3Boolean *nominals,
                                    fmi3Boolean *states, fmi3Boolean *timed, fmi3Float64 *next) {
    if (!MAY(EVENTS) || !instance_has(c, __func__, 1, update, end) || !instance_has(c, __func__, 1, nominals, states) ||
        !instance_has(c, __func__, 1, timed, next)) {
        return fmi3Error;
    }
    *update = *end = *nominals = *states = *timed = fmi3False;
    *next = 0.0;
    return fmi3OK;
}

/* Model exchange. */

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) {
    REFUSE_UNLESS(EVENTS);
    ((Instance *)c)->model.values.mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean forward, fmi3Boolean *event, fmi3Boolean *end) {
    (void)forward;
    if (!MAY(CONTINUOUS) || !instance_has(c, __func__, 1, event, end)) {
        return fmi3Error;
    }
    *event = *end = fmi3False;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
    return STATUS(MAY(EXCHANGING) && instance_time(c, __func__, time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 states[], size_t count) {
    return STATUS(MAY(EXCHANGING) && instance_set_states(c, __func__, states, count));
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 derivatives[], size_t count) {
    return STATUS(MAY(EVALUATED) &&
                  instance_states(c, __func__, derivatives, count, THE_DERIVATIVES));
}

fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 indicators[], size_t count) {
    (void)indicators;
    return none(c, __func__, count ? "this model has no event indicators" : 0);
}

fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 states[], size_t count) {
    return STATUS(MAY(EVALUATED) && instance_states(c, __func__, states, count, THE_STATES));
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 nominals[], size_t count) {
    return STATUS(MAY(EVALUATED) && instance_states(c, __func__, nominals, count, THE_NOMINALS));
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count) {
    if (!MAY(ANY) || !instance_has(c, __func__, 1, count, count)) {
        return fmi3Error;
    }
    *count = 0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count) {
    if (!MAY(ANY) || !instance_has(c, __func__, 1, count, count)) {
        return fmi3Error;
    }
#ifdef BELT
    *count = ALL_STATES;
#else
    *count = STATES;
#endif
    return fmi3OK;
}

/* Co-simulation. */

fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    return none(c, __func__, "this model is always in step mode: it has no event mode");
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                                    const fmi3Int32 orders[], fmi3Float64 values[], size_t size) {
    (void)references;
    (void)orders;
    (void)values;
    (void)size;
    return none(c, __func__, count ? "outputs have no derivatives here" : 0);
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean final, fmi3Boolean *event,
                      fmi3Boolean *end, fmi3Boolean *early, fmi3Float64 *reached) {
    Model *model;
    int right;
    (void)final;
    if (!MAY(STEPPING) || !instance_has(c, __func__, 1, event, end) || !instance_has(c, __func__, 1, early, reached)) {
        return fmi3Error;
    }
    model = &((Instance *)c)->model;
    right = instance_said(c, __func__, model_step(model, time, step));
    *event = *end = *early = fmi3False;
    *reached = model->values.now.time;
    return STATUS(right);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock;
    (void)time;
    return none(c, __func__, "this model has no scheduled execution");
}
