"""Errors that campaigns of several tests are made with."""

#: Errors of sensors and rig, each within 1.3 of its standard uncertainties.
ERRORS = {
    "undeclared": {
        "gain F1": 4e-3,
        "gain V1": -6e-3,
        "gain V2": 2e-3,
        "phase F1": 2e-3,
        "phase V1": 3e-3,
        "phase V2": -4e-3,
    },
    "rig_error": {"moving_mass": 0.008, "preload_stiffness": -0.009, "preload_damping": 0.2},
}
