/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* The functions of FMI 2.0, model exchange and co-simulation. */
#include "fmi2Functions.h"
#include "instance.h"

#include <stdlib.h>
#include <string.h>

/* After initialization, in one of the two kinds of simulation; where states have values; at any time. */
enum { EXCHANGING = EVENTS | CONTINUOUS, RUNNING = EXCHANGING | STEPPING,
       EVALUATED = INITIALIZATION | EXCHANGING | TERMINATED, STARTING = INSTANTIATED | INITIALIZATION,
       ANY = STARTING | RUNNING | TERMINATED };

#define STATUS(right) ((right) ? fmi2OK : fmi2Error)
#define MAY(modes) instance_may(c, __func__, (modes))
#define REFUSE_UNLESS(modes) do { if (!MAY(modes)) { return fmi2Error; } } while (0)

static void log_error(const Instance *instance, const char *message) {
    const fmi2CallbackFunctions *callbacks = instance->logger;
    if (callbacks->logger) {
        callbacks->logger(instance->environment, instance->name, fmi2Error, "logStatusError", message);
    }
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[]) {
    (void)on;
    return STATUS(MAY(ANY) && instance_has(c, __func__, count, categories, categories));
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources;
    (void)visible;
    (void)logging;
    if (!callbacks || (type != fmi2CoSimulation && type != fmi2ModelExchange)) {
        return 0;
    }
    return instance_new(name, token, type == fmi2CoSimulation, callbacks->componentEnvironment, log_error, callbacks,
                        sizeof *callbacks);
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerated, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean bounded, fmi2Real stop) {
    (void)tolerated;
    (void)tolerance;
    return STATUS(MAY(INSTANTIATED) && instance_start(c, __func__, start, bounded, stop));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    REFUSE_UNLESS(INSTANTIATED);
    ((Instance *)c)->model.values.mode = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *instance = c;
    REFUSE_UNLESS(INITIALIZATION);
    model_initialise(&instance->model, instance->stepped ? STEPPING : EVENTS);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    REFUSE_UNLESS(RUNNING);
    ((Instance *)c)->model.values.mode = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    REFUSE_UNLESS(ANY);
    model_reset(&((Instance *)c)->model);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[]) {
    return STATUS(MAY(ANY) && instance_has(c, __func__, count, references, values) &&
                  instance_get(c, __func__, references, count, values));
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                       const fmi2Real values[]) {
    return STATUS(MAY(ANY) && instance_has(c, __func__, count, references, values) &&
                  instance_set(c, __func__, references, count, values));
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          fmi2Integer values[]) {
    size_t at;
    if (!MAY(ANY) || !instance_has(c, __func__, count, references, values)) {
        return fmi2Error;
    }
    for (at = 0; at < count; at++) {
        const char *wrong = model_get_integer(&((Instance *)c)->model, references[at], &values[at]);
        if (!instance_said_of(c, __func__, references[at], wrong)) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          const fmi2Integer values[]) {
    size_t at;
    if (!MAY(ANY) || !instance_has(c, __func__, count, references, values)) {
        return fmi2Error;
    }
    for (at = 0; at < count; at++) {
        Model *model = &((Instance *)c)->model;
        const char *wrong = model_set_integer(model, references[at], values[at]);
        if (!instance_said_of(c, __func__, references[at], wrong)) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

/* There are no variables of these types. */
static fmi2Status none_of(fmi2Component c, const char *function, size_t count) {
    return STATUS(instance_may(c, function, ANY) &&
                  instance_said(c, function, count ? "this model has no variable of this type" : 0));
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          fmi2Boolean values[]) {
    (void)references;
    (void)values;
    return none_of(c, __func__, count);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          const fmi2Boolean values[]) {
    (void)references;
    (void)values;
    return none_of(c, __func__, count);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2String values[]) {
    (void)references;
    (void)values;
    return none_of(c, __func__, count);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference references[], size_t count,
                         const fmi2String values[]) {
    (void)references;
    (void)values;
    return none_of(c, __func__, count);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    return STATUS(MAY(ANY) && instance_save(c, __func__, state));
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    return STATUS(MAY(ANY) && instance_restore(c, __func__, state));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    REFUSE_UNLESS(ANY);
    if (state) {
        free(*state);
        *state = 0;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    if (!MAY(ANY) || !instance_has(c, __func__, 1, state, size)) {
        return fmi2Error;
    }
    *size = sizeof(Saved);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    return STATUS(MAY(ANY) && instance_serialise(c, __func__, state, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    return STATUS(MAY(ANY) && instance_deserialise(c, __func__, bytes, size, state));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t count,
                                        const fmi2ValueReference knowns[], size_t known, const fmi2Real seed[],
                                        fmi2Real changes[]) {
    return STATUS(MAY(ANY) && instance_change(c, __func__, unknowns, count, knowns, known, seed, changes));
}

/* Model exchange. */

fmi2Status fmi2EnterEventMode(fmi2Component c) {
    REFUSE_UNLESS(EXCHANGING);
    ((Instance *)c)->model.values.mode = EVENTS;
    return fmi2OK;
}

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *event) {
    if (!MAY(EVENTS) || !instance_has(c, __func__, 1, event, event)) {
        return fmi2Error;
    }
    memset(event, 0, sizeof *event);
    return fmi2OK;
}

fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) {
    REFUSE_UNLESS(EVENTS);
    ((Instance *)c)->model.values.mode = CONTINUOUS;
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean forward, fmi2Boolean *event, fmi2Boolean *end) {
    (void)forward;
    if (!MAY(CONTINUOUS) || !instance_has(c, __func__, 1, event, end)) {
        return fmi2Error;
    }
    *event = *end = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    return STATUS(MAY(EXCHANGING) && instance_time(c, __func__, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real states[], size_t count) {
    return STATUS(MAY(EXCHANGING) && instance_set_states(c, __func__, states, count));
}

fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real derivatives[], size_t count) {
    return STATUS(MAY(EVALUATED) && instance_states(c, __func__, derivatives, count, THE_DERIVATIVES));
}

fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real indicators[], size_t count) {
    (void)indicators;
    return STATUS(MAY(EVALUATED) && instance_said(c, __func__, count ? "this model has no event indicators" : 0));
}

fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real states[], size_t count) {
    return STATUS(MAY(EVALUATED) && instance_states(c, __func__, states, count, THE_STATES));
}

fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real nominals[], size_t count) {
    return STATUS(MAY(EVALUATED) && instance_states(c, __func__, nominals, count, THE_NOMINALS));
}

/* Co-simulation. */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[]) {
    size_t at;
    if (!MAY(STEPPING | STARTING) || !instance_has(c, __func__, count, references, values) ||
        !instance_has(c, __func__, count, orders, orders)) {
        return fmi2Error;
    }
    for (at = 0; at < count; at++) {
        const char *wrong = orders[at] == 1 ? model_slope(&((Instance *)c)->model, references[at], values[at])
                                            : "takes the first derivative only";
        if (!instance_said_of(c, __func__, references[at], wrong)) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[]) {
    (void)references;
    (void)orders;
    (void)values;
    return STATUS(MAY(STEPPING) && instance_said(c, __func__, count ? "outputs have no derivatives here" : 0));
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean final) {
    (void)final;
    REFUSE_UNLESS(STEPPING);
    return STATUS(instance_said(c, __func__, model_step(&((Instance *)c)->model, time, step)));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    return STATUS(MAY(ANY) && instance_said(c, __func__, "no step is under way: each ends before fmi2DoStep returns"));
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)kind;
    (void)value;
    return MAY(ANY) ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    REFUSE_UNLESS(ANY);
    if (kind != fmi2LastSuccessfulTime || !value) {
        return fmi2Discard;
    }
    *value = ((Instance *)c)->model.values.now.time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)kind;
    (void)value;
    return MAY(ANY) ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    REFUSE_UNLESS(ANY);
    if (kind != fmi2Terminated || !value) {
        return fmi2Discard;
    }
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)kind;
    (void)value;
    return MAY(ANY) ? fmi2Discard : fmi2Error;
}
