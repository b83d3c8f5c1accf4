/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* A spring and a damper parallel to branches that relax: parameters, states, exact steps in time.
 *
 * The deflection x is the displacement of the contact less that of the wheel, positive in compression. The force that
 * pushes the wheel away from the contact is
 *
 *     F = preload + rest x + damping x' + sum of k (x - z),
 *
 * where a branch of stiffness k and relaxation time tau has the state z [m] with tau z' = x - z. A pair of branches has
 * the complex state z' = lambda (x - z) and the force Re k (x - z). All units are SI.
 */
#ifndef BRANCHES_H
#define BRANCHES_H

#include "model.h" /* sizes of this model; model.c has its numbers */

#include <stddef.h>

/* Value references. */
enum {
    TIME,
    CONTACT,
    CONTACT_RATE,
    WHEEL,
    WHEEL_RATE,
    FORCE,
    POINT,
    PRELOAD,
    DRAW,
    FIRST_STATE,
    FIRST_DERIVATIVE = FIRST_STATE + STATES,
    FIRST_PARAMETER = FIRST_DERIVATIVE + STATES,
    VARIABLES = FIRST_PARAMETER + PARAMETERS
};

/* Room of an array, which C does not allow to be zero. */
#define ROOM(count) ((count) > 0 ? (count) : 1)

/* The numbers of this model, in model.c: counts per operating point; parameters, their least values, and all names. */
extern const int model_branches[POINTS], model_pairs[POINTS], model_first[POINTS];
extern const double model_defaults[ROOM(PARAMETERS)], model_least[ROOM(PARAMETERS)];
extern const double model_draws[ROOM(DRAWS * PARAMETERS)]; /* draw by draw, in the order of the parameters */
extern const char *const model_names[VARIABLES];

/* What a step changes. */
typedef struct {
    double time;                     /* [s] */
    double inputs[4];                /* displacement [m] and velocity [m/s] of contact and wheel */
    double slopes[4];                /* their time derivatives over the next step, where given */
    double states[ROOM(STATES)];     /* at the beginning of the last step; with step = 0, at `time` */
    double step;                     /* duration of the last step [s] */
    double x0, v0;                   /* deflection [m] and its rate [m/s] at the beginning of the last step */
    double x1, v1;                   /* the same at its end, as far as the inputs were known before it */
    int sloped;                      /* which slopes were given, as bits */
    int updated;                     /* whether an input was set since the last step */
} Motion;

/* All that a saved state holds. */
typedef struct {
    Motion now;
    double stop;                     /* end of the experiment [s] */
    double preload;                  /* [N] */
    double parameters[ROOM(PARAMETERS)];
    int point;                       /* operating point, from 1 */
    int draw;                        /* draw from the uncertainty, from 1; 0: the parameters */
    int mode;                        /* what the importer may call; see below */
    int bounded;                     /* whether the experiment has an end */
} Values;

/* Modes, as bits. */
enum { INSTANTIATED = 1, INITIALIZATION = 2, EVENTS = 4, CONTINUOUS = 8, STEPPING = 16, TERMINATED = 32 };

/* Factors of a step, which depend on its duration: per mode exp(-w) and the integrals of `integrals`. */
typedef struct {
    double step;
    double factors[ROOM(STATES)][8];
} Factors;

typedef struct {
    Values values;
    Factors factors;
} Model;

/* Each returns 0, or words for the importer's log on what is wrong; then nothing has changed. */
const char *model_set(Model *model, unsigned int reference, double value);
const char *model_get(Model *model, unsigned int reference, double *value);
const char *model_slope(Model *model, unsigned int reference, double value);
const char *model_set_integer(Model *model, unsigned int reference, double value);
const char *model_get_integer(const Model *model, unsigned int reference, int *value);
const char *model_step(Model *model, double time, double step);
const char *model_change(Model *model, unsigned int *unknown, const unsigned int *knowns, size_t count,
                         const double *seed, double *change); /* if wrong, `unknown` becomes the wrong variable */
const char *model_restore(Model *model, const Values *saved);

void model_reset(Model *model);
void model_initialise(Model *model, int next);
void model_states(Model *model, double *states, double *derivatives);
int model_number(double value);

#endif
