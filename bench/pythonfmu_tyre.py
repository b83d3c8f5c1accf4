"""The tyre of bench_fmu.py as pythonfmu has it: exact steps of branches, straight between samples, factors kept."""

from __future__ import annotations

from math import exp, expm1

from pythonfmu import Fmi2Causality, Fmi2Slave, Real

REST, SPRINGS, TIMES = 150e3, (60e3, 40e3, 30e3), (0.5, 0.02, 0.001)
INPUTS = ("contact_displacement", "contact_velocity", "wheel_displacement", "wheel_velocity")


class Tyre(Fmi2Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.contact_displacement = self.contact_velocity = self.wheel_displacement = self.wheel_velocity = 0.0
        self.force = 0.0
        self.states = [0.0] * len(TIMES)
        self.factors, self.step = [], 0.0
        for name in INPUTS:
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        self.register_variable(Real("force", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        x = self.contact_displacement - self.wheel_displacement
        self.states = [x] * len(TIMES)
        self.force = REST * x

    def do_step(self, current_time, step_size):  # noqa: ARG002
        if step_size != self.step:
            self.step = step_size
            self.factors = [(exp(-step_size / tau), 1 + tau / step_size * expm1(-step_size / tau)) for tau in TIMES]
        x = self.contact_displacement - self.wheel_displacement
        far = step_size * (self.contact_velocity - self.wheel_velocity)
        end = x + far
        self.states = [x + e * (z - x) + i * far for z, (e, i) in zip(self.states, self.factors, strict=True)]
        self.force = REST * end + sum(k * (end - z) for k, z in zip(SPRINGS, self.states, strict=True))
        return True
