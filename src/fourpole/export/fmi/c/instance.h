/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* What both versions of FMI have in common: an instance, its messages, and its saved states. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "branches.h"

#include <stddef.h>

/* Writes a message to the log of the importer. */
typedef struct Instance Instance;
struct Instance {
    Model model;
#ifdef BELT
    Model belt;                        /* see belt.c */
    double slopes[4], started[4];      /* slopes and inputs of the model when the last call began */
    int sloped;
#endif
    int stepped;                       /* whether it is for co-simulation */
    char *name;
    void *environment;
    void (*log)(const Instance *instance, const char *message);
    void *logger;                      /* memory with the importer's own functions */
};

/* A saved state. */
typedef struct {
    char token[sizeof TOKEN];
    Values values;
#ifdef BELT
    Values belt;
#endif
} Saved;

Instance *instance_new(const char *name, const char *token, int stepped, void *environment,
                       void (*log)(const Instance *, const char *), const void *logger, size_t size);
void instance_free(Instance *instance);

/* Each returns 1; or 0 after a message, and then nothing has changed. */
int instance_may(Instance *instance, const char *function, int modes);
int instance_has(Instance *instance, const char *function, size_t count, const void *one, const void *other);
int instance_said(Instance *instance, const char *function, const char *wrong);
int instance_said_of(Instance *instance, const char *function, unsigned int reference, const char *wrong);
int instance_start(Instance *instance, const char *function, double start, int bounded, double stop);

int instance_set(Instance *instance, const char *function, const unsigned int *references, size_t count,
                 const double *values);
int instance_get(Instance *instance, const char *function, const unsigned int *references, size_t count,
                 double *values);
int instance_time(Instance *instance, const char *function, double time);
int instance_set_states(Instance *instance, const char *function, const double *states, size_t count);
int instance_states(Instance *instance, const char *function, double *found, size_t count, int which);
int instance_change(Instance *instance, const char *function, const unsigned int *unknowns, size_t count,
                    const unsigned int *knowns, size_t known, const double *seed, double *changes);

int instance_save(Instance *instance, const char *function, void **saved);
int instance_restore(Instance *instance, const char *function, const void *saved);
int instance_serialise(Instance *instance, const char *function, const void *saved, void *bytes, size_t size);
int instance_deserialise(Instance *instance, const char *function, const void *bytes, size_t size, void **saved);
#ifdef BELT

/* The variables and states of both models, and the part of the contact in the motion of the belt by operating point. */
enum { CONTACT_FORCE = VARIABLES, ALL_STATES = 2 * STATES, ALL_VARIABLES = CONTACT_FORCE + 1 + ALL_STATES };
extern const double model_weights[POINTS];

void belt_follow(Instance *instance); /* at the beginning of each call: what the call before has changed */
const char *belt_get(Instance *instance, unsigned int reference, double *value);
const char *belt_change(Instance *instance, unsigned int *of, const unsigned int *knowns, size_t count,
                        const double *seed, double *change);
#endif

/* What `instance_states` finds. */
enum { THE_STATES, THE_DERIVATIVES, THE_NOMINALS };

#endif
