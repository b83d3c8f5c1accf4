"""FMUs at work: their sources and binaries, and both versions of FMI in FMPy behind the same names."""

from __future__ import annotations

import ctypes
import os
import shutil
import zipfile
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from fourpole.core.specimen import Form, Specimen
from fourpole.export.fmi import fmu
from fourpole.export.fmi.description import COMPILERS, common_source, model_source
from fourpole.export.fmi.variables import Point, is_belted, states_of_part
from fourpole.models.families import model_named
from fourpole.models.realised import belt_modes, realised, weight
from fourpole.paper1982.shell import RADIAL_PLY, Shell

#: A model with inertia, and thus with pairs of states; of few modes, so that its files are small.
SHELL = Shell(around=8, across=1, moving=(3, 1))
BAND = (1.0, 100.0)
#: Models and their parameters, at the operating points of the FMU that the tests drive.
MODELS = {
    "zener": [180e3, 120e3, 700.0],
    "kelvin": [200e3, 300.0],
    "maxwell:3": [150e3, 60e3, 40e3, 30e3, 0.5, 0.02, 0.001],
    "fractional": [150e3, 400e3, 1e-3, 0.4],
}
BELT = Specimen(Form.BELT, 7.0, 0.2)
WITH_INERTIA = {SHELL: list(RADIAL_PLY), "zener": MODELS["zener"]}
INPUTS = [1, 2, 3, 4]
FORCE, POINT, PRELOAD, DRAW, STATE = 5, 6, 7, 8, 9


def compiler():
    """A C compiler; without one a test is skipped, and fails on the machine that decides."""
    found = next((path for name in COMPILERS if (path := shutil.which(name))), None)
    if found is None:
        if os.environ.get("CI") == "true":
            pytest.fail(f"the tests of FMUs need a C compiler: {', '.join(COMPILERS)}")
        pytest.skip("no C compiler")
    return found


def points(models=MODELS, belt=None):
    each = ((model_named(model) if isinstance(model, str) else model, values) for model, values in models.items())
    found = [Point(model.name, realised(model, values, BAND)) for model, values in each]
    if belt is None:
        return found
    belted = [Point(one.label, one.system, belt_modes(one.system, belt, BAND), weight(belt)) for one in found]
    return [Point("massless", found[0].system), *belted]


def states_in(several):
    """Number of states."""
    return states_of_part(several) * (1 + is_belted(several))


#: Number of states of the FMU of all models.
STATES = states_in(points())


def made(folder, version, models=MODELS, belt=None):
    """An FMU of models as operating points, with its binary."""
    compiler()
    content, notes = fmu("tyre", "Vertical force of tyre", points(models, belt), version)
    assert notes == []
    path = Path(folder, f"tyre{version}.fmu")
    path.write_bytes(content)
    return path


def sources(folder, version, models, belt=None):
    """The folder with the C source of an FMU, without the binary."""
    common = common_source(version, belted=belt is not None)
    for name, text in (common | model_source(points(models, belt), "{token}")).items():
        Path(folder, name).write_text(text, encoding="utf-8")
    return folder


def unpacked(path, folder):
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    return Path(folder)


#: Names of what FMPy calls differently in FMI 3.0.
NAMES = {
    2: ("setReal", "getReal", "setInteger", "newDiscreteStates", "getDerivatives", "deSerializeFMUstate"),
    3: ("setFloat64", "getFloat64", "setInt32", "updateDiscreteStates", "getContinuousStateDerivatives",
        "deserializeFMUState"),
}  # fmt: skip


class Instance:
    """An instance in FMPy, for co-simulation or model exchange, of FMI 2.0 or 3.0; `said` is its log."""

    def __init__(self, folder, version, *, stepped=True, name="one", token=None, identifier="tyre"):
        import fmpy
        from fmpy import fmi2, fmi3

        self.said = []
        self.version = version
        kinds = {2: (fmi2.FMU2Model, fmi2.FMU2Slave), 3: (fmi3.FMU3Model, fmi3.FMU3Slave)}
        guid = fmpy.read_model_description(str(folder)).guid if token is None else token
        self.it = kinds[version][stepped](
            guid=guid, unzipDirectory=str(folder), modelIdentifier=identifier, instanceName=name
        )
        names = ("set", "get", "choose", "update", "derivatives", "state_of")
        for own, theirs in zip(names, NAMES[version], strict=True):
            setattr(self, f"_{own}", getattr(self.it, theirs, None))
        if version == 2:
            self.callbacks = fmi2.fmi2CallbackFunctions()
            self.callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(lambda *all_of_it: self._say(all_of_it))
            self.it.instantiate(callbacks=self.callbacks)
        else:
            self.it.instantiate(logMessage=lambda *all_of_it: self._say(all_of_it))

    def _say(self, message):
        self.said.append(message[-1].decode())

    def setup(self, stop=None):
        if self.version == 2:
            self.it.setupExperiment(startTime=0.0, stopTime=stop)
            self.it.enterInitializationMode()
        else:
            self.it.enterInitializationMode(startTime=0.0, stopTime=stop)

    def start(self, point=1, inputs=(0.0, 0.0, 0.0, 0.0), stop=None):
        self.setup(stop)
        self.choose(point)
        self.put(INPUTS, inputs)
        self.it.exitInitializationMode()

    def exchange(self):
        self._update()
        self.it.enterContinuousTimeMode()

    def choose(self, point):
        self._choose([POINT], [point])

    def put(self, places, values):
        self._set(list(places), [float(one) for one in values])

    def get(self, *places):
        return np.array(self._get(list(places)))

    @property
    def force(self):
        return float(self.get(FORCE)[0])

    def step(self, time, duration):
        self.it.doStep(currentCommunicationPoint=time, communicationStepSize=duration)

    def derivatives(self, count=STATES):
        return self._array(self._derivatives, count=count)

    def states(self, count=STATES):
        return self._array(self.it.getContinuousStates, count=count)

    def set_states(self, values):
        self._array(self.it.setContinuousStates, values)

    def _array(self, call, values=None, count=STATES):
        held = np.zeros(count) if values is None else np.array(values, dtype=float)
        call(held.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), held.size)
        return held

    def state_of(self, content):
        return self._state_of(content)

    def slopes(self, places, values):
        self.it.setRealInputDerivatives(list(places), [1] * len(places), [float(one) for one in values])

    def changes(self, unknowns, knowns, seed):
        return np.array(self.it.getDirectionalDerivative(list(unknowns), list(knowns), list(seed)))


@contextmanager
def instance(folder, version, **more):
    one = Instance(folder, version, **more)
    try:
        yield one
    finally:
        one.it.freeInstance()
