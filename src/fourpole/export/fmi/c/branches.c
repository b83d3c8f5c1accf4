/* SPDX-License-Identifier: BSD-3-Clause; copyright the Fourpole developers. */

/* The arithmetic: see branches.h. Nothing but a C99 compiler is needed, no mathematics library. */
#include "branches.h"

#include <stddef.h>
#include <string.h>

/* Coefficients of the deflection over a step, x = x0 + c1 s + c2 s^2 + c3 s^3 with s from 0 to 1. */
typedef struct {
    double c1, c2, c3;
} Path;

/* Round-off of lengths, and of the time, up to which the velocity at the beginning of a step leads to its end. */
static const double STRAIGHT = 1e-12, OF_CLOCK = 1e-15;
/* Tolerance of the time at which a step begins: a share of the step, and of the time. */
static const double OF_STEP = 1e-6, OF_TIME = 1e-9;

int model_number(double value) { return value - value == 0.0; }

static double size(double value) { return value < 0.0 ? -value : value; }

static double larger(double one, double other) { return one > other ? one : other; }

static const double *parameters(const Model *model) {
    const Values *values = &model->values;
    const double *numbers = values->draw ? model_draws + (size_t)(values->draw - 1) * PARAMETERS : values->parameters;
    return numbers + model_first[values->point - 1];
}

static int branches(const Model *model) { return model_branches[model->values.point - 1]; }

static int pairs(const Model *model) { return model_pairs[model->values.point - 1]; }

/* exp(-w) and w times the integrals of exp(-w (1 - s)) s^k over s from 0 to 1, for k = 1 to 3; w is complex.
 *
 * With |w| < 1 by their power series, else by parts from one k to the next, which loses a digit at most. */
static void integrals(double re, double im, double *found) {
    double integral[4][2], scale = 1.0;
    double large = larger(size(re), size(im));
    int halvings = 0, k, j;
    if (large < 1.0) {
        for (k = 0; k < 4; k++) {
            double term_re = re / (k + 1), term_im = im / (k + 1);
            integral[k][0] = integral[k][1] = 0.0;
            for (j = 0; j < 24; j++) {
                double next = k + 2 + j, kept = term_re;
                integral[k][0] += term_re;
                integral[k][1] += term_im;
                term_re = -(kept * re - term_im * im) / next;
                term_im = -(kept * im + term_im * re) / next;
            }
        }
        found[0] = 1.0 - integral[0][0];
        found[1] = -integral[0][1];
    } else {
        double e_re = 0.0, e_im = 0.0, inverse_re, inverse_im, ratio;
        if (re < 750.0) { /* else it is below the smallest number */
            while (large * scale >= 0.5) {
                scale *= 0.5;
                halvings++;
            }
            integrals(re * scale, im * scale, found);
            e_re = found[0];
            e_im = found[1];
            for (j = 0; j < halvings; j++) {
                double kept = e_re;
                e_re = kept * kept - e_im * e_im;
                e_im = 2.0 * kept * e_im;
            }
        }
        ratio = size(re) >= size(im) ? im / re : re / im; /* 1/w without overflow */
        if (size(re) >= size(im)) {
            inverse_re = 1.0 / (re * (1.0 + ratio * ratio));
            inverse_im = -ratio * inverse_re;
        } else {
            inverse_im = -1.0 / (im * (1.0 + ratio * ratio));
            inverse_re = -ratio * inverse_im;
        }
        integral[0][0] = 1.0 - e_re;
        integral[0][1] = -e_im;
        for (k = 1; k < 4; k++) {
            integral[k][0] = 1.0 - k * (inverse_re * integral[k - 1][0] - inverse_im * integral[k - 1][1]);
            integral[k][1] = -k * (inverse_re * integral[k - 1][1] + inverse_im * integral[k - 1][0]);
        }
        found[0] = e_re;
        found[1] = e_im;
    }
    for (k = 1; k < 4; k++) {
        found[2 * k] = integral[k][0];
        found[2 * k + 1] = integral[k][1];
    }
}

static void prepare(Model *model, double step) {
    const double *each = parameters(model) + 2;
    int at, count = branches(model), twice = pairs(model);
    if (model->factors.step == step) {
        return;
    }
    for (at = 0; at < count; at++, each += 2) {
        integrals(step / each[1], 0.0, model->factors.factors[at]);
    }
    for (at = 0; at < twice; at++, each += 4) {
        integrals(step * each[2], step * each[3], model->factors.factors[count + at]);
    }
    model->factors.step = step;
}

static double deflection(const Model *model) {
    return model->values.now.inputs[CONTACT - CONTACT] - model->values.now.inputs[WHEEL - CONTACT];
}

static double rate(const Model *model) {
    return model->values.now.inputs[CONTACT_RATE - CONTACT] - model->values.now.inputs[WHEEL_RATE - CONTACT];
}

/* Whether the deflection goes from x0 to x1 along a straight line with the rate that it has at its beginning. */
static int straight(const Values *values, double x1) {
    double far = values->now.step * values->now.v0;
    double scale = size(values->now.x0) + size(x1) + size(values->now.inputs[0]) + size(values->now.inputs[2]);
    return size(x1 - values->now.x0 - far) <= STRAIGHT * scale + OF_CLOCK * size(values->now.v0 * values->now.time);
}

/* The straight line where the deflection follows it, else the cubic through both ends and both rates. */
static Path path_to(const Values *values, double x1, double v1) {
    Path path;
    double far = x1 - values->now.x0, first = values->now.step * values->now.v0, last = values->now.step * v1;
    if (straight(values, x1)) {
        path.c1 = far;
        path.c2 = path.c3 = 0.0;
    } else {
        path.c1 = first;
        path.c2 = 3.0 * far - 2.0 * first - last;
        path.c3 = first + last - 2.0 * far;
    }
    return path;
}

/* The deflection and its rate at the present time: those of the inputs, or where the last step was to end. */
static void present(const Model *model, double *x, double *v) {
    const Values *values = &model->values;
    int ahead = values->now.step > 0.0 && !values->now.updated;
    *x = ahead ? values->now.x1 : deflection(model);
    *v = ahead ? values->now.v1 : rate(model);
}

/* The states at rest at a deflection. */
static void at_rest(const Model *model, double x, double *states) {
    int at, count = branches(model), all = count + pairs(model);
    for (at = 0; at < all; at++) {
        states[at < count ? at : 2 * at - count] = x;
    }
}

/* The states at the present time, with the deflection x and the rate v there. */
static void states_now(Model *model, double x, double v, double *states) {
    const Values *values = &model->values;
    int at, count = branches(model), all = count + pairs(model);
    Path path;
    memset(states, 0, sizeof values->now.states);
    if (values->mode & (INSTANTIATED | INITIALIZATION)) {
        at_rest(model, x, states);
        return;
    }
    memcpy(states, values->now.states, sizeof values->now.states);
    if (values->now.step == 0.0) {
        return;
    }
    prepare(model, values->now.step);
    path = path_to(values, x, v);
    for (at = 0; at < all; at++) {
        const double *by = model->factors.factors[at];
        double moved_re = by[2] * path.c1 + by[4] * path.c2 + by[6] * path.c3;
        double moved_im = by[3] * path.c1 + by[5] * path.c2 + by[7] * path.c3;
        double *state = states + (at < count ? at : 2 * at - count);
        double re = state[0] - values->now.x0;
        if (at < count) {
            state[0] = values->now.x0 + by[0] * re + moved_re;
        } else {
            double im = state[1];
            state[0] = values->now.x0 + by[0] * re - by[1] * im + moved_re;
            state[1] = by[0] * im + by[1] * re + moved_im;
        }
    }
}

/* Force without the preload, which is a linear function of deflection, rate and states. */
static double force_of(const Model *model, double x, double v, const double *states) {
    const double *each = parameters(model);
    int at, count = branches(model), twice = pairs(model);
    double force = each[0] * x + each[1] * v;
    each += 2;
    for (at = 0; at < count; at++, each += 2, states++) {
        force += each[0] * (x - states[0]);
    }
    for (at = 0; at < twice; at++, each += 4, states += 2) {
        force += each[0] * (x - states[0]) + each[1] * states[1];
    }
    return force;
}

/* Derivatives of the states, which are linear functions, too; those of idle states are zero. */
static void rates_of(const Model *model, double x, const double *states, double *derivatives) {
    const double *each = parameters(model) + 2;
    int at, count = branches(model), twice = pairs(model);
    memset(derivatives, 0, sizeof model->values.now.states);
    for (at = 0; at < count; at++, each += 2, states++) {
        *derivatives++ = (x - states[0]) / each[1];
    }
    for (at = 0; at < twice; at++, each += 4, states += 2) {
        *derivatives++ = each[2] * (x - states[0]) + each[3] * states[1];
        *derivatives++ = each[3] * (x - states[0]) - each[2] * states[1];
    }
}

void model_states(Model *model, double *states, double *derivatives) {
    double x, v, found[ROOM(STATES)], rates[ROOM(STATES)];
    present(model, &x, &v);
    states_now(model, x, v, found);
    rates_of(model, x, found, rates);
    memcpy(states, found, STATES * sizeof *found);
    memcpy(derivatives, rates, STATES * sizeof *rates);
}

void model_reset(Model *model) {
    memset(model, 0, sizeof *model);
    memcpy(model->values.parameters, model_defaults, sizeof model_defaults);
    model->values.point = 1;
    model->values.mode = INSTANTIATED;
}

void model_initialise(Model *model, int next) {
    double x, v, states[ROOM(STATES)];
    present(model, &x, &v);
    states_now(model, x, v, states);
    memcpy(model->values.now.states, states, sizeof states);
    model->values.mode = next;
}

const char *model_get_integer(const Model *model, unsigned int reference, int *value) {
    if (reference != POINT && reference != DRAW) {
        return "is no integer";
    }
    *value = reference == POINT ? model->values.point : model->values.draw;
    return 0;
}

const char *model_set_integer(Model *model, unsigned int reference, double value) {
    if (reference != POINT && reference != DRAW) {
        return "is no integer";
    }
    if (!(model->values.mode & (INSTANTIATED | INITIALIZATION))) {
        return "is a parameter: it can be set before the end of the initialization only";
    }
    if (reference == DRAW) {
        if (!(value >= 0.0 && value <= DRAWS)) {
            return "is the number of a draw that this model does not have";
        }
        model->values.draw = (int)value;
        model->factors.step = 0.0;
        return 0;
    }
#ifdef BELT
    if (!(value >= 1.0 && value <= POINTS / 2)) { /* behind them are those of the belt */
#else
    if (!(value >= 1.0 && value <= POINTS)) {
#endif
        return "is the number of an operating point that this model does not have";
    }
    model->values.point = (int)value;
    model->factors.step = 0.0;
    return 0;
}

const char *model_set(Model *model, unsigned int reference, double value) {
    Values *values = &model->values;
    if (reference >= VARIABLES) {
        return "is no variable of this model";
    }
    if (reference == POINT || reference == DRAW) {
        return "is an integer";
    }
    if (!model_number(value)) {
        return "cannot have a value that is not a finite number";
    }
    if (reference >= CONTACT && reference <= WHEEL_RATE) {
        if (values->mode == TERMINATED) {
            return "cannot be set after the end of the simulation";
        }
        values->now.inputs[reference - CONTACT] = value;
        values->now.updated = 1;
        return 0;
    }
    if (reference != PRELOAD && reference < FIRST_PARAMETER) {
        return "is computed and cannot be set";
    }
    if (!(values->mode & (INSTANTIATED | INITIALIZATION))) {
        return "is a parameter: it can be set before the end of the initialization only";
    }
    if (reference == PRELOAD) {
        values->preload = value;
        return 0;
    }
    if (value < model_least[reference - FIRST_PARAMETER]) {
        return "cannot have so small a value: a stiffness at rest and a damping are at least zero, a time, a decay and "
               "a frequency are above zero";
    }
    values->parameters[reference - FIRST_PARAMETER] = value;
    model->factors.step = 0.0;
    return 0;
}

const char *model_get(Model *model, unsigned int reference, double *value) {
    const Values *values = &model->values;
    double x, v, states[ROOM(STATES)];
    if (reference >= VARIABLES || reference == POINT || reference == DRAW) {
        return reference >= VARIABLES ? "is no variable of this model" : "is an integer";
    }
    if (reference == TIME) {
        *value = values->now.time;
    } else if (reference <= WHEEL_RATE) {
        *value = values->now.inputs[reference - CONTACT];
    } else if (reference == PRELOAD) {
        *value = values->preload;
    } else if (reference >= FIRST_PARAMETER) {
        *value = values->parameters[reference - FIRST_PARAMETER];
    } else {
        present(model, &x, &v);
        states_now(model, x, v, states);
        if (reference == FORCE) {
            *value = values->preload + force_of(model, x, v, states);
        } else if (reference < FIRST_DERIVATIVE) {
            *value = states[reference - FIRST_STATE];
        } else {
            double derivatives[ROOM(STATES)];
            rates_of(model, x, states, derivatives);
            *value = derivatives[reference - FIRST_DERIVATIVE];
        }
    }
    return 0;
}

const char *model_slope(Model *model, unsigned int reference, double value) {
    if (reference < CONTACT || reference > WHEEL_RATE) {
        return "is no input: only inputs have derivatives";
    }
    if (!model_number(value)) {
        return "cannot have a derivative that is not a finite number";
    }
    model->values.now.slopes[reference - CONTACT] = value;
    model->values.now.sloped |= 1 << (reference - CONTACT);
    return 0;
}

/* How far an input displacement moves over a step, and how its velocity changes: by their derivatives where given. */
static void moved(const Values *values, int at, double step, double *far, double *faster) {
    *faster = step * values->now.slopes[at + 1];
    *far = step * (values->now.inputs[at + 1] + 0.5 * *faster);
    if (values->now.sloped & 1 << at) {
        *far = step * values->now.slopes[at];
    }
}

/* Where a step will end: by the derivatives of the inputs if any is given, else by the rate of the deflection and its
 * change over the step before, if that was not straight. */
static void predict(Values *values, double x, double v, double acceleration, double step) {
    double contact = step * (v + 0.5 * step * acceleration), wheel = 0.0, faster = step * acceleration, slower = 0.0;
    if (values->now.sloped) {
        moved(values, CONTACT - CONTACT, step, &contact, &faster);
        moved(values, WHEEL - CONTACT, step, &wheel, &slower);
    }
    values->now.x1 = x + contact - wheel;
    values->now.v1 = v + faster - slower;
}

const char *model_step(Model *model, double time, double step) {
    Values *values = &model->values;
    Motion before = values->now;
    double states[ROOM(STATES)], x = deflection(model), v = rate(model), acceleration, force;
    if (!model_number(time) || !model_number(step) || !(step > 0.0) || !model_number(time + step)) {
        return "the time of a step must be a finite number, and its duration a positive one";
    }
    if (size(time - values->now.time) > OF_STEP * step + OF_TIME * size(time)) {
        return "the step does not begin where the last one ended";
    }
    if (values->bounded && time + step > values->stop + OF_STEP * step + OF_TIME * size(time)) {
        return "the step goes beyond the end of the experiment";
    }
    states_now(model, x, v, states);
    acceleration = values->now.step > 0.0 && !straight(values, x) ? (v - values->now.v0) / values->now.step : 0.0;
    predict(values, x, v, acceleration, step);
    memcpy(values->now.states, states, sizeof states);
    values->now.x0 = x;
    values->now.v0 = v;
    values->now.step = step;
    values->now.updated = values->now.sloped = 0;
    memset(values->now.slopes, 0, sizeof values->now.slopes);
    values->now.time = time + step;
    model_get(model, FORCE, &force);
    if (!model_number(force)) {
        values->now = before;
        return "the force is not a finite number: the inputs are too large";
    }
    return 0;
}

const char *model_change(Model *model, unsigned int *unknown, const unsigned int *knowns, size_t count,
                         const double *seed, double *change) {
    double x = 0.0, v = 0.0, states[ROOM(STATES)], derivatives[ROOM(STATES)];
    size_t at;
    int starting = model->values.mode & (INSTANTIATED | INITIALIZATION);
    memset(states, 0, sizeof states);
    for (at = 0; at < count; at++) {
        if (knowns[at] == CONTACT || knowns[at] == WHEEL) {
            x += knowns[at] == CONTACT ? seed[at] : -seed[at];
        } else if (knowns[at] == CONTACT_RATE || knowns[at] == WHEEL_RATE) {
            v += knowns[at] == CONTACT_RATE ? seed[at] : -seed[at];
        } else if (knowns[at] >= FIRST_STATE && knowns[at] < FIRST_DERIVATIVE && !starting) {
            states[knowns[at] - FIRST_STATE] += seed[at];
        } else {
            *unknown = knowns[at];
            return "is none of the variables by which there are derivatives: inputs and, after initialization, states";
        }
    }
    if (starting) {
        at_rest(model, x, states);
    }
    if (*unknown == FORCE) {
        *change = force_of(model, x, v, states);
    } else if (*unknown >= FIRST_DERIVATIVE && *unknown < FIRST_PARAMETER) {
        rates_of(model, x, states, derivatives);
        *change = derivatives[*unknown - FIRST_DERIVATIVE];
    } else if (starting && *unknown >= FIRST_STATE && *unknown < FIRST_DERIVATIVE) {
        *change = states[*unknown - FIRST_STATE];
    } else {
        return "is none of the variables that have derivatives: the force and the derivatives of the states";
    }
    return 0;
}

const char *model_restore(Model *model, const Values *saved) {
    int at;
    int known = saved->mode == INSTANTIATED || saved->mode == INITIALIZATION || saved->mode == EVENTS ||
                saved->mode == CONTINUOUS || saved->mode == STEPPING || saved->mode == TERMINATED;
    const Motion *now = &saved->now;
    double sum = saved->stop + saved->preload + now->time + now->step + now->x0 + now->v0 + now->x1 + now->v1;
    for (at = 0; at < 4; at++) {
        sum += now->inputs[at] + now->slopes[at];
    }
    for (at = 0; at < STATES; at++) {
        sum += now->states[at];
    }
    for (at = 0; at < PARAMETERS; at++) {
        known = known && saved->parameters[at] >= model_least[at];
        sum += saved->parameters[at];
    }
    if (!known || !model_number(sum) || !(now->step >= 0.0) || saved->point < 1 || saved->point > POINTS ||
        saved->draw < 0 || saved->draw > DRAWS) {
        return "the saved state is not one of this model";
    }
    model->values = *saved;
    model->factors.step = 0.0;
    return 0;
}
