/* Drives an FMU of FMI 2.0 that is compiled with it: right calls, wrong calls, saved states; all memory is given back. */
#include "fmi2Functions.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#ifdef BELT /* the springs and the belt have as many states, and the points of the belt are behind */
#define SETS 2
#else
#define SETS 1
#endif
#define COUNT (SETS * STATES)

static int said;

static void log_it(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    (void)category;
    said++;
    if (status != fmi2Error || !name || !strlen(message)) {
        abort();
    }
}

static void expect(int right, int line) {
    if (!right) {
        printf("line %d is not as it should be\n", line);
        exit(1);
    }
}

#define RIGHT(call) expect((call) == fmi2OK, __LINE__)
#define WRONG(call) do { int before = said; expect((call) == fmi2Error && said == before + 1, __LINE__); } while (0)
#define MISSING(call) expect((call) == fmi2Error, __LINE__)

int main(void) {
    fmi2CallbackFunctions callbacks = {log_it, calloc, free, 0, 0};
    fmi2CallbackFunctions silent = {0, calloc, free, 0, 0};
    const fmi2ValueReference inputs[] = {1, 2, 3, 4}, force[] = {5}, point[] = {6}, far[] = {4000000000u};
    const fmi2Integer one[] = {1}, second[] = {2}, none[] = {-7}, many[] = {POINTS + 1};
    double motion[4] = {0.0, 0.06, 0.0, 0.0}, found[1], again, more[COUNT + 1];
    const double seed[] = {1.0};
    fmi2FMUstate state = 0, other = 0;
    fmi2EventInfo event;
    fmi2Boolean yes, no;
    fmi2Byte *bytes;
    size_t size, at;
    fmi2Component c, d;

    expect(!fmi2Instantiate("a", fmi2CoSimulation, "another", "", &callbacks, 0, 0) && said == 1, __LINE__);
    expect(!fmi2Instantiate("", fmi2CoSimulation, TOKEN, "", &callbacks, 0, 0) && said == 2, __LINE__);
    expect(!fmi2Instantiate(0, fmi2CoSimulation, 0, 0, &silent, 0, 0), __LINE__);
    expect(!fmi2Instantiate("a", fmi2CoSimulation, TOKEN, "", 0, 0, 0), __LINE__);
    expect(!fmi2Instantiate("a", (fmi2Type)9, TOKEN, "", &callbacks, 0, 0), __LINE__);
    MISSING(fmi2SetReal(0, inputs, 4, motion));
    MISSING(fmi2DoStep(0, 0.0, 1e-3, 0));
    MISSING(fmi2GetFMUstate(0, &state));
    MISSING(fmi2SetFMUstate(0, 0));
    fmi2FreeInstance(0);

    c = fmi2Instantiate("a", fmi2CoSimulation, TOKEN, "", &callbacks, 0, 1);
    d = fmi2Instantiate("b", fmi2CoSimulation, TOKEN, "", &callbacks, 0, 1);
    expect(c && d, __LINE__);
    WRONG(fmi2DoStep(c, 0.0, 1e-3, 0));
    WRONG(fmi2ExitInitializationMode(c));
    WRONG(fmi2SetupExperiment(c, 0, 0.0, NAN, 0, 0.0));
    WRONG(fmi2SetupExperiment(c, 0, 0.0, 1.0, 1, 0.5));
    RIGHT(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0));
    RIGHT(fmi2EnterInitializationMode(c));
    WRONG(fmi2SetInteger(c, point, 1, none));
    WRONG(fmi2SetInteger(c, point, 1, many));
    WRONG(fmi2SetInteger(c, point, 1, 0));
    WRONG(fmi2SetInteger(c, force, 1, one));
    WRONG(fmi2SetReal(c, 0, 4, motion));
    WRONG(fmi2GetReal(c, far, 1, found));
    WRONG(fmi2GetString(c, point, 1, 0));
    RIGHT(fmi2SetInteger(c, point, 1, POINTS > SETS ? second : one));
    RIGHT(fmi2SetReal(c, inputs, 4, motion));
    RIGHT(fmi2GetReal(c, force, 1, found));
    RIGHT(fmi2ExitInitializationMode(c));
    for (at = 0; at < 50; at++) {
        RIGHT(fmi2DoStep(c, 1e-3 * at, 1e-3, 1));
        motion[0] = 1e-3 * sin(60e-3 * (at + 1));
        motion[1] = 60e-3 * cos(60e-3 * (at + 1));
        RIGHT(fmi2SetReal(c, inputs, 4, motion));
        RIGHT(fmi2GetReal(c, force, 1, found));
        expect(isfinite(found[0]), __LINE__);
    }
    WRONG(fmi2DoStep(c, 0.05, 0.0, 1));
    WRONG(fmi2DoStep(c, 0.05, -1e-3, 1));
    WRONG(fmi2DoStep(c, 0.05, NAN, 1));
    WRONG(fmi2DoStep(c, NAN, 1e-3, 1));
    WRONG(fmi2DoStep(c, 7.0, 1e-3, 1));
    RIGHT(fmi2DoStep(c, 0.05, 1e-300, 1));
    RIGHT(fmi2DoStep(c, 0.05, 1e9, 1));
    WRONG(fmi2SetRealInputDerivatives(c, inputs, 1, second, seed));
    WRONG(fmi2SetRealInputDerivatives(c, force, 1, one, seed));
    RIGHT(fmi2SetRealInputDerivatives(c, inputs, 1, one, seed));
    WRONG(fmi2EnterEventMode(c));
    WRONG(fmi2CancelStep(c));

    RIGHT(fmi2GetFMUstate(c, &state));
    RIGHT(fmi2GetFMUstate(c, &state));
    RIGHT(fmi2SerializedFMUstateSize(c, state, &size));
    bytes = malloc(size);
    WRONG(fmi2SerializeFMUstate(c, state, bytes, size - 1));
    WRONG(fmi2SerializeFMUstate(c, 0, bytes, size));
    RIGHT(fmi2SerializeFMUstate(c, state, bytes, size));
    WRONG(fmi2DeSerializeFMUstate(d, bytes, size - 1, &other));
    WRONG(fmi2DeSerializeFMUstate(d, 0, size, &other));
    for (at = 0; at < size; at++) { /* bytes that were changed are refused, or are another state: no crash */
        fmi2Byte kept = bytes[at];
        bytes[at] = (fmi2Byte)~kept;
        if (fmi2DeSerializeFMUstate(d, bytes, size, &other) == fmi2OK) {
            RIGHT(fmi2SetFMUstate(d, other));
            (void)fmi2GetReal(d, force, 1, found);
            RIGHT(fmi2FreeFMUstate(d, &other));
        }
        bytes[at] = kept;
    }
    RIGHT(fmi2DeSerializeFMUstate(d, bytes, size, &other));
    RIGHT(fmi2SetFMUstate(d, other));
    RIGHT(fmi2GetReal(c, force, 1, found));
    RIGHT(fmi2GetReal(d, force, 1, &again));
    expect(again == found[0], __LINE__);
    WRONG(fmi2SetFMUstate(d, 0));
    RIGHT(fmi2FreeFMUstate(d, &other));
    RIGHT(fmi2FreeFMUstate(d, &other));
    RIGHT(fmi2FreeFMUstate(c, &state));
    free(bytes);
    RIGHT(fmi2GetDirectionalDerivative(c, force, 1, inputs, 1, seed, found));
    WRONG(fmi2GetDirectionalDerivative(c, far, 1, inputs, 1, seed, found));
    WRONG(fmi2GetDirectionalDerivative(c, force, 1, far, 1, seed, found));
    RIGHT(fmi2Terminate(c));
    WRONG(fmi2DoStep(c, 0.05, 1e-3, 1));
    WRONG(fmi2SetReal(c, inputs, 4, motion));
    RIGHT(fmi2Reset(c));
    RIGHT(fmi2EnterInitializationMode(c));
    fmi2FreeInstance(c);
    fmi2FreeInstance(d);

    c = fmi2Instantiate("c", fmi2ModelExchange, TOKEN, "", &callbacks, 0, 1);
    RIGHT(fmi2EnterInitializationMode(c));
    RIGHT(fmi2ExitInitializationMode(c));
    WRONG(fmi2DoStep(c, 0.0, 1e-3, 1));
    RIGHT(fmi2NewDiscreteStates(c, &event));
    RIGHT(fmi2EnterContinuousTimeMode(c));
    WRONG(fmi2SetTime(c, INFINITY));
    RIGHT(fmi2SetTime(c, 0.1));
    WRONG(fmi2GetContinuousStates(c, more, COUNT + 1));
    RIGHT(fmi2GetContinuousStates(c, more, COUNT));
    RIGHT(fmi2GetNominalsOfContinuousStates(c, more, COUNT));
    RIGHT(fmi2SetContinuousStates(c, more, COUNT));
    RIGHT(fmi2GetDerivatives(c, more, COUNT));
    RIGHT(fmi2CompletedIntegratorStep(c, 1, &yes, &no));
    WRONG(fmi2CompletedIntegratorStep(c, 1, 0, &no));
    expect(!yes && !no, __LINE__);
    more[0] = NAN;
    if (COUNT > 0) {
        WRONG(fmi2SetContinuousStates(c, more, COUNT));
        WRONG(fmi2GetDerivatives(c, 0, COUNT));
    }
    fmi2FreeInstance(c);
    puts("as it should be");
    return 0;
}
