/* Steps an FMU of FMI 2.0 over a motion: sets its inputs, steps, gets its force; returns the CPU time of the loop [s]. */
#define _POSIX_C_SOURCE 199309L
#include "fmi2FunctionTypes.h"

#include <dlfcn.h>
#include <stdlib.h>
#include <time.h>

static void silent(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    (void)name;
    (void)status;
    (void)category;
    (void)message;
}

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

double drive(const char *library, const char *token, const char *resources, const unsigned int *inputs,
             unsigned int output, long steps, double step, const double *motion, double *forces) {
    fmi2CallbackFunctions callbacks = {silent, calloc, free, 0, 0};
    void *binary = dlopen(library, RTLD_NOW);
    double start, took = -1.0;
    long at;
    if (!binary) {
        return -1.0;
    }
    fmi2InstantiateTYPE *instantiate = (fmi2InstantiateTYPE *)dlsym(binary, "fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = (fmi2SetupExperimentTYPE *)dlsym(binary, "fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter =
        (fmi2EnterInitializationModeTYPE *)dlsym(binary, "fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = (fmi2ExitInitializationModeTYPE *)dlsym(binary, "fmi2ExitInitializationMode");
    fmi2SetRealTYPE *set = (fmi2SetRealTYPE *)dlsym(binary, "fmi2SetReal");
    fmi2GetRealTYPE *get = (fmi2GetRealTYPE *)dlsym(binary, "fmi2GetReal");
    fmi2DoStepTYPE *go = (fmi2DoStepTYPE *)dlsym(binary, "fmi2DoStep");
    fmi2FreeInstanceTYPE *release = (fmi2FreeInstanceTYPE *)dlsym(binary, "fmi2FreeInstance");
    fmi2Component c = instantiate("bench", fmi2CoSimulation, token, resources, &callbacks, 0, 0);
    if (!c || setup(c, 0, 0.0, 0.0, 0, 0.0) != fmi2OK || enter(c) != fmi2OK || set(c, inputs, 4, motion) != fmi2OK ||
        leave(c) != fmi2OK) {
        return -2.0;
    }
    start = now();
    for (at = 0; at < steps; at++) {
        if (set(c, inputs, 4, motion + 4 * at) != fmi2OK || go(c, step * at, step, 1) != fmi2OK ||
            get(c, &output, 1, forces + at) != fmi2OK) {
            return -3.0;
        }
    }
    took = now() - start;
    release(c);
    return took;
}
