/* Drives an FMU of FMI 3.0 that is compiled with it: right calls, wrong calls, saved states; all memory is given back. */
#include "fmi3Functions.h"

#include <math.h>
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

static void log_it(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)environment;
    said++;
    if (status != fmi3Error || strcmp(category, "logStatusError") != 0 || !strlen(message)) {
        abort();
    }
}

static void expect(int right, int line) {
    if (!right) {
        printf("line %d is not as it should be\n", line);
        exit(1);
    }
}

#define RIGHT(call) expect((call) == fmi3OK, __LINE__)
#define WRONG(call) do { int before = said; expect((call) == fmi3Error && said == before + 1, __LINE__); } while (0)
#define MISSING(call) expect((call) == fmi3Error, __LINE__)

int main(void) {
    const fmi3ValueReference inputs[] = {1, 2, 3, 4}, force[] = {5}, point[] = {6}, far[] = {4000000000u};
    const fmi3Int32 none[] = {0}, many[] = {POINTS + 1}, last[] = {POINTS / SETS};
    const double seed[] = {1.0};
    double motion[4] = {0.0, 0.06, 0.0, 0.0}, found[1], more[COUNT + 1], reached;
    fmi3Boolean event, end, early, states, timed;
    fmi3Float32 narrow[1];
    fmi3FMUState state = 0, other = 0;
    fmi3Byte *bytes;
    size_t size, at;
    fmi3Instance c;

    expect(!fmi3InstantiateCoSimulation("a", "another", "", 0, 0, 0, 0, 0, 0, 0, log_it, 0) && said == 1, __LINE__);
    expect(!fmi3InstantiateCoSimulation("a", TOKEN, "", 0, 0, 1, 0, 0, 0, 0, log_it, 0) && said == 2, __LINE__);
    expect(!fmi3InstantiateCoSimulation(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0), __LINE__);
    expect(!fmi3InstantiateScheduledExecution("a", TOKEN, "", 0, 0, 0, log_it, 0, 0, 0) && said == 3, __LINE__);
    MISSING(fmi3SetFloat64(0, inputs, 4, motion, 4));
    MISSING(fmi3DoStep(0, 0.0, 1e-3, 0, &event, &end, &early, &reached));
    fmi3FreeInstance(0);

    c = fmi3InstantiateCoSimulation("a", TOKEN, "", 0, 1, 0, 0, 0, 0, 0, log_it, 0);
    expect(c != 0, __LINE__);
    WRONG(fmi3DoStep(c, 0.0, 1e-3, 0, &event, &end, &early, &reached));
    WRONG(fmi3EnterInitializationMode(c, 0, 0.0, NAN, 0, 0.0));
    RIGHT(fmi3EnterInitializationMode(c, 0, 0.0, 0.0, 1, 1.0));
    WRONG(fmi3SetInt32(c, point, 1, none, 1));
    WRONG(fmi3SetInt32(c, point, 1, many, 1));
    WRONG(fmi3SetInt32(c, point, 1, last, 0));
    WRONG(fmi3SetFloat64(c, inputs, 4, motion, 3));
    WRONG(fmi3SetFloat64(c, 0, 4, motion, 4));
    WRONG(fmi3GetFloat64(c, far, 1, found, 1));
    WRONG(fmi3GetFloat32(c, force, 1, narrow, 1));
    WRONG(fmi3EnterConfigurationMode(c));
    RIGHT(fmi3SetInt32(c, point, 1, last, 1));
    RIGHT(fmi3SetFloat64(c, inputs, 4, motion, 4));
    RIGHT(fmi3ExitInitializationMode(c));
    for (at = 0; at < 50; at++) {
        RIGHT(fmi3DoStep(c, 1e-3 * at, 1e-3, 1, &event, &end, &early, &reached));
        motion[0] = 1e-3 * sin(60e-3 * (at + 1));
        motion[1] = 60e-3 * cos(60e-3 * (at + 1));
        RIGHT(fmi3SetFloat64(c, inputs, 4, motion, 4));
        RIGHT(fmi3GetFloat64(c, force, 1, found, 1));
        expect(isfinite(found[0]) && !event && !end && !early && fabs(reached - 1e-3 * (at + 1)) < 1e-12, __LINE__);
    }
    WRONG(fmi3DoStep(c, 0.05, 0.0, 1, &event, &end, &early, &reached));
    WRONG(fmi3DoStep(c, 0.05, 2.0, 1, &event, &end, &early, &reached));
    WRONG(fmi3DoStep(c, 0.05, 1e-3, 1, &event, &end, 0, &reached));
    WRONG(fmi3EnterStepMode(c));
    WRONG(fmi3EnterEventMode(c));
    RIGHT(fmi3GetFMUState(c, &state));
    RIGHT(fmi3SerializedFMUStateSize(c, state, &size));
    bytes = malloc(size);
    WRONG(fmi3SerializeFMUState(c, state, bytes, size - 1));
    RIGHT(fmi3SerializeFMUState(c, state, bytes, size));
    WRONG(fmi3DeserializeFMUState(c, bytes, size - 1, &other));
    RIGHT(fmi3DeserializeFMUState(c, bytes, size, &other));
    RIGHT(fmi3SetFMUState(c, other));
    WRONG(fmi3SetFMUState(c, 0));
    RIGHT(fmi3FreeFMUState(c, &other));
    RIGHT(fmi3FreeFMUState(c, &state));
    free(bytes);
    RIGHT(fmi3GetDirectionalDerivative(c, force, 1, inputs, 1, seed, 1, found, 1));
    WRONG(fmi3GetDirectionalDerivative(c, force, 1, inputs, 1, seed, 2, found, 1));
    WRONG(fmi3GetAdjointDerivative(c, force, 1, inputs, 1, seed, 1, found, 1));
    RIGHT(fmi3GetNumberOfContinuousStates(c, &size));
    expect(size == COUNT, __LINE__);
    RIGHT(fmi3Terminate(c));
    RIGHT(fmi3Reset(c));
    fmi3FreeInstance(c);

    c = fmi3InstantiateModelExchange("c", TOKEN, "", 0, 1, 0, log_it);
    RIGHT(fmi3EnterInitializationMode(c, 0, 0.0, 0.0, 0, 0.0));
    motion[0] = 1e-3;
    RIGHT(fmi3SetFloat64(c, inputs, 4, motion, 4));
    RIGHT(fmi3GetContinuousStates(c, more, COUNT));
    expect(COUNT == 0 || SETS > 1 || more[0] == 1e-3, __LINE__);
    RIGHT(fmi3ExitInitializationMode(c));
    RIGHT(fmi3UpdateDiscreteStates(c, &event, &end, &early, &states, &timed, &reached));
    RIGHT(fmi3EnterContinuousTimeMode(c));
    WRONG(fmi3SetTime(c, NAN));
    RIGHT(fmi3SetTime(c, 0.1));
    WRONG(fmi3SetContinuousStates(c, more, COUNT + 1));
    RIGHT(fmi3SetContinuousStates(c, more, COUNT));
    RIGHT(fmi3GetContinuousStateDerivatives(c, more, COUNT));
    RIGHT(fmi3CompletedIntegratorStep(c, 1, &event, &end));
    WRONG(fmi3DoStep(c, 0.1, 1e-3, 1, &event, &end, &early, &reached));
    fmi3FreeInstance(c);
    puts("as it should be");
    return 0;
}
