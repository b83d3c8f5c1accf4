/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* The belt of a specimen: a second model, of the force Q that accelerates the belt, by the mean motion of both ends.
 *
 * With the weight u of the contact, y = u contact + (1 - u) wheel, and F of the springs by contact less wheel, the force
 * on the wheel is F - (1 - u) Q, and that into the contact is F + u Q. The operating points of the second model are those
 * behind the points of the first one. */
#include "instance.h"

#include <string.h>

static double weight(const Instance *instance) { return model_weights[instance->model.values.point - 1]; }

static double mean(const Instance *instance, double contact, double wheel) {
    double u = weight(instance);
    return u * contact + (1.0 - u) * wheel;
}

/* How far an input goes per time over a step, as the first model predicts it. */
static double ahead(const Instance *instance, int at, double step) {
    const double *slopes = instance->slopes;
    return instance->sloped & 1 << at ? slopes[at] : instance->started[at + 1] + 0.5 * step * slopes[at + 1];
}

void belt_follow(Instance *instance) {
    const Values *first = &instance->model.values;
    const Motion *from = &first->now;
    Values *values = &instance->belt.values;
    Motion *now = &values->now;
    if (first->mode & (INSTANTIATED | INITIALIZATION)) {
        model_reset(&instance->belt);
    } else if (values->mode & (INSTANTIATED | INITIALIZATION)) {
        model_initialise(&instance->belt, first->mode);
    } else if (from->step > 0.0 && from->time != now->time) {
        if (instance->sloped) {
            now->slopes[0] = mean(instance, ahead(instance, 0, from->step), ahead(instance, 2, from->step));
            now->slopes[1] = mean(instance, instance->slopes[1], instance->slopes[3]);
            now->sloped = 3;
        }
        model_step(&instance->belt, now->time, from->step);
    }
    memcpy(values->parameters, first->parameters, sizeof first->parameters);
    memcpy(instance->slopes, from->slopes, sizeof from->slopes);
    memcpy(instance->started, from->inputs, sizeof from->inputs);
    instance->sloped = from->sloped;
    values->point = first->point + POINTS / 2;
    values->draw = first->draw;
    values->mode = first->mode;
    now->time = from->time;
    now->updated = from->updated;
    now->inputs[0] = mean(instance, from->inputs[0], from->inputs[2]);
    now->inputs[1] = mean(instance, from->inputs[1], from->inputs[3]);
}

/* The variable of the second model that a variable is: its force for both forces, or a state or its derivative. */
static unsigned int own(unsigned int reference) {
    return reference > CONTACT_FORCE ? reference - CONTACT_FORCE - 1 + FIRST_STATE : FORCE;
}

/* Part of the force Q in one of both forces. */
static double part(const Instance *instance, unsigned int reference) {
    return reference == FORCE ? weight(instance) - 1.0 : weight(instance);
}

const char *belt_get(Instance *instance, unsigned int reference, double *value) {
    double force = 0.0;
    const char *wrong = 0;
    if (reference < VARIABLES && reference != FORCE) {
        return model_get(&instance->model, reference, value);
    }
    if (reference == FORCE || reference == CONTACT_FORCE) {
        wrong = model_get(&instance->model, FORCE, &force);
        model_get(&instance->belt, FORCE, value);
        *value = force + part(instance, reference) * *value;
        return wrong;
    }
    return reference < ALL_VARIABLES ? model_get(&instance->belt, own(reference), value)
                                     : "is no variable of this model";
}

/* Change of one variable by one other one. */
static const char *change_by(Instance *instance, unsigned int of, unsigned int known, double seed, double *change) {
    static const unsigned int OF_BELT[5] = {0, CONTACT, CONTACT_RATE, CONTACT, CONTACT_RATE};
    const char *wrong = 0;
    double found = 0.0;
    int is_force = of == FORCE || of == CONTACT_FORCE, is_input = known >= CONTACT && known <= WHEEL_RATE;
    *change = 0.0;
    if (known < VARIABLES && of <= CONTACT_FORCE) {
        unsigned int unknown = is_force ? FORCE : of;
        wrong = model_change(&instance->model, &unknown, &known, 1, &seed, change);
    }
    if (!wrong && of >= ALL_VARIABLES) {
        wrong = "is no variable of this model";
    }
    if (!wrong && (is_force || of > CONTACT_FORCE) && (is_input || known > CONTACT_FORCE)) {
        unsigned int unknown = own(of), by = is_input ? OF_BELT[known] : own(known);
        double u = known <= CONTACT_RATE ? weight(instance) : 1.0 - weight(instance);
        seed *= is_input ? u : 1.0;
        wrong = model_change(&instance->belt, &unknown, &by, 1, &seed, &found);
        *change += is_force ? part(instance, of) * found : found;
    }
    return wrong;
}

const char *belt_change(Instance *instance, unsigned int *of, const unsigned int *knowns, size_t count,
                        const double *seed, double *change) {
    size_t at;
    *change = 0.0;
    for (at = 0; at < count; at++) {
        double one;
        const char *wrong = change_by(instance, *of, knowns[at], seed[at], &one);
        if (wrong) {
            return wrong;
        }
        *change += one;
    }
    return 0;
}
