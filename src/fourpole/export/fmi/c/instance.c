/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* See instance.h. */
#include "instance.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Size of a deflection for the tolerances of an integrator [m]. */
static const double NOMINAL = 1e-3;

int instance_said(Instance *instance, const char *function, const char *wrong) {
    char message[600];
    if (!wrong) {
        return 1;
    }
    snprintf(message, sizeof message, "%s: %s", function, wrong);
    instance->log(instance, message);
    return 0;
}

int instance_said_of(Instance *instance, const char *function, unsigned int reference, const char *wrong) {
    char message[600];
    if (!wrong) {
        return 1;
    }
    if (reference < VARIABLES) {
        snprintf(message, sizeof message, "%s: %s %s", function, model_names[reference], wrong);
    } else {
        snprintf(message, sizeof message, "%s: value reference %u %s", function, reference, wrong);
    }
    instance->log(instance, message);
    return 0;
}

Instance *instance_new(const char *name, const char *token, int stepped, void *environment,
                       void (*log)(const Instance *, const char *), const void *logger, size_t size) {
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) {
        return 0;
    }
    instance->logger = calloc(1, size);
    instance->name = calloc(1, name ? strlen(name) + 1 : 1);
    if (!instance->logger || !instance->name) {
        instance_free(instance);
        return 0;
    }
    memcpy(instance->logger, logger, size);
    if (name) {
        strcpy(instance->name, name);
    }
    instance->stepped = stepped;
    instance->environment = environment;
    instance->log = log;
    model_reset(&instance->model);
    if (!name || !*name) {
        instance_said(instance, "instantiate", "the instance has no name");
    } else if (!token || strcmp(token, TOKEN) != 0) {
        instance_said(instance, "instantiate", "the token is not that of this model: its description is of another");
    } else {
        return instance;
    }
    instance_free(instance);
    return 0;
}

void instance_free(Instance *instance) {
    if (instance) {
        free(instance->logger);
        free(instance->name);
        free(instance);
    }
}

int instance_may(Instance *instance, const char *function, int modes) {
    if (!instance) {
        return 0;
    }
#ifdef BELT
    belt_follow(instance);
#endif
    return instance_said(instance, function, instance->model.values.mode & modes ? 0 : "is not allowed now");
}

int instance_has(Instance *instance, const char *function, size_t count, const void *one, const void *other) {
    return instance_said(instance, function, count && (!one || !other) ? "an array is missing" : 0);
}

int instance_start(Instance *instance, const char *function, double start, int bounded, double stop) {
    Values *values = &instance->model.values;
    if (!model_number(start) || (bounded && !(model_number(stop) && stop > start))) {
        return instance_said(instance, function, "start and stop must be finite numbers, and the stop later");
    }
    values->now.time = start;
    values->bounded = bounded;
    values->stop = bounded ? stop : 0.0;
    return 1;
}

int instance_set(Instance *instance, const char *function, const unsigned int *references, size_t count,
                 const double *values) {
    size_t at;
    for (at = 0; at < count; at++) {
        const char *wrong = model_set(&instance->model, references[at], values[at]);
        if (wrong) {
            return instance_said_of(instance, function, references[at], wrong);
        }
    }
    return 1;
}

int instance_get(Instance *instance, const char *function, const unsigned int *references, size_t count,
                 double *values) {
    size_t at;
    for (at = 0; at < count; at++) {
#ifdef BELT
        const char *wrong = belt_get(instance, references[at], &values[at]);
#else
        const char *wrong = model_get(&instance->model, references[at], &values[at]);
#endif
        if (wrong) {
            return instance_said_of(instance, function, references[at], wrong);
        }
    }
    return 1;
}

int instance_time(Instance *instance, const char *function, double time) {
    if (!model_number(time)) {
        return instance_said(instance, function, "the time is not a finite number");
    }
    instance->model.values.now.time = time;
    return 1;
}

static int has_states(Instance *instance, const char *function, const void *states, size_t count) {
#ifdef BELT
    const char *wrong = count == ALL_STATES ? 0 : "the number of states is not that of this model";
    return instance_said(instance, function, wrong) && instance_has(instance, function, count, states, states);
#else
    return instance_said(instance, function, count == STATES ? 0 : "the number of states is not that of this model") &&
           instance_has(instance, function, count, states, states);
#endif
}

int instance_set_states(Instance *instance, const char *function, const double *states, size_t count) {
    size_t at;
    if (!has_states(instance, function, states, count)) {
        return 0;
    }
    for (at = 0; at < count; at++) {
        if (!model_number(states[at])) {
            return instance_said(instance, function, "a state is not a finite number");
        }
    }
#ifdef BELT
    count = STATES;
    memcpy(instance->belt.values.now.states, states + STATES, count * sizeof *states);
#endif
    memcpy(instance->model.values.now.states, states, count * sizeof *states);
    return 1;
}

int instance_states(Instance *instance, const char *function, double *found, size_t count, int which) {
    double other[ROOM(STATES)];
    size_t at;
    if (!has_states(instance, function, found, count)) {
        return 0;
    }
#ifdef BELT
    if (which == THE_STATES) {
        model_states(&instance->belt, found + STATES, other);
    } else if (which == THE_DERIVATIVES) {
        model_states(&instance->belt, other, found + STATES);
    }
#endif
    if (which == THE_STATES) {
        model_states(&instance->model, found, other);
    } else if (which == THE_DERIVATIVES) {
        model_states(&instance->model, other, found);
    } else {
        for (at = 0; at < count; at++) {
            found[at] = NOMINAL;
        }
    }
    return 1;
}

int instance_change(Instance *instance, const char *function, const unsigned int *unknowns, size_t count,
                    const unsigned int *knowns, size_t known, const double *seed, double *changes) {
    size_t at;
    if (!instance_has(instance, function, count, unknowns, changes) ||
        !instance_has(instance, function, known, knowns, seed)) {
        return 0;
    }
    for (at = 0; at < count; at++) {
        unsigned int of = unknowns[at];
#ifdef BELT
        const char *wrong = belt_change(instance, &of, knowns, known, seed, &changes[at]);
#else
        const char *wrong = model_change(&instance->model, &of, knowns, known, seed, &changes[at]);
#endif
        if (wrong) {
            return instance_said_of(instance, function, of, wrong);
        }
    }
    return 1;
}

int instance_save(Instance *instance, const char *function, void **saved) {
    Saved *made;
    if (!saved) {
        return instance_said(instance, function, "there is no place for the state");
    }
    made = *saved ? *saved : calloc(1, sizeof *made);
    if (!made) {
        return instance_said(instance, function, "there is no memory for the state");
    }
    memcpy(made->token, TOKEN, sizeof made->token);
    memcpy(&made->values, &instance->model.values, sizeof made->values);
#ifdef BELT
    memcpy(&made->belt, &instance->belt.values, sizeof made->belt);
#endif
    *saved = made;
    return 1;
}

/* A message unless a saved state is one of this model. */
static int is_own(Instance *instance, const char *function, const Saved *saved) {
    int own = saved && memcmp(saved->token, TOKEN, sizeof saved->token) == 0;
    return instance_said(instance, function, own ? 0 : "the state is not one of this model");
}

int instance_restore(Instance *instance, const char *function, const void *saved) {
    const Values *values;
    if (!is_own(instance, function, saved)) {
        return 0;
    }
    values = &((const Saved *)saved)->values;
    if (values->mode & (instance->stepped ? EVENTS | CONTINUOUS : STEPPING)) {
        return instance_said(instance, function, "the state is of the other kind of simulation");
    }
#ifdef BELT
    if (!instance_said(instance, function, model_restore(&instance->belt, &((const Saved *)saved)->belt))) {
        return 0;
    }
#endif
    return instance_said(instance, function, model_restore(&instance->model, values));
}

int instance_serialise(Instance *instance, const char *function, const void *saved, void *bytes, size_t size) {
    if (!is_own(instance, function, saved) || !instance_has(instance, function, 1, bytes, bytes)) {
        return 0;
    }
    if (size < sizeof(Saved)) {
        return instance_said(instance, function, "there is too little room for the bytes of a state");
    }
    memcpy(bytes, saved, sizeof(Saved));
    return 1;
}

int instance_deserialise(Instance *instance, const char *function, const void *bytes, size_t size, void **saved) {
    Model *tried;
    Saved *made;
    int fits;
    if (!saved || !bytes || size != sizeof(Saved)) {
        return instance_said(instance, function, "these are not the bytes of a state of this model");
    }
    made = calloc(1, sizeof *made);
    tried = calloc(1, sizeof *tried);
    if (!made || !tried) {
        free(made);
        free(tried);
        return instance_said(instance, function, "there is no memory for the state");
    }
    memcpy(made, bytes, sizeof *made);
    fits = is_own(instance, function, made) &&
           instance_said(instance, function, model_restore(tried, &made->values));
#ifdef BELT
    fits = fits && instance_said(instance, function, model_restore(tried, &made->belt));
#endif
    free(tried);
    if (!fits) {
        free(made);
        return 0;
    }
    *saved = made;
    return 1;
}
