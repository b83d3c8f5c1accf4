"""Numbers that decide what a folder of recordings is guessed to be: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.guess import channels, signals, specimens, together
from fourpole.guess.channels import Column, Role, checked_force, static_roles
from fourpole.guess.gather import _recorded
from fourpole.guess.names import read_name
from fourpole.guess.together import _Together

AT = np.arange(4000)
FORCE = Role("force_in", "F1", "N", "force")


def kind(turns=0.1, share=1.0, rate=100.0, first=1.0, count=4000):
    """Kind of a recording, by the turns per sample of its line, its share, and the size of its first quarter."""
    samples = np.where(AT[:count] < count / 4, first, 1.0) * np.sin(2 * np.pi * turns * AT[:count])
    return signals._kind(SimpleNamespace(line=(turns, share), rate=rate, samples=samples))


def slow(*lines):
    """Whether a motion of sines [Hz] of some shares of the variance is slow."""
    samples = sum(np.sqrt(share) * np.sin(2 * np.pi * hertz * AT / 100) for hertz, share in lines)
    return signals._is_slow(SimpleNamespace(samples=samples, rate=100.0))


def excited(low=10.0, parts=32, *, is_swept=False):
    """Kind of excitation of a band from a frequency to 100 Hz, with power in some of 32 parts of 10 s."""
    samples = np.where(np.arange(3200) < 100 * parts, (-1.0) ** np.arange(3200), 0.0)
    motion = SimpleNamespace(is_swept=is_swept, has_sines=False)
    given = {"_band": lambda *given: (low, 100.0), "motion_of": lambda *given: motion}
    given |= dict.fromkeys(("segment_of", "fine_spectrum"), MagicMock())
    with patch.multiple(signals, **given):
        found = signals.excitation_of(samples, 320.0)
    return found and found[0]


def frequency(stated):
    """The frequency of a test of 10 Hz, where another one is stated."""
    one = SimpleNamespace(shape=SimpleNamespace(kind="dynamic"), frequency=10.0, rate=None)
    conditions = MagicMock(values={"frequency": stated})
    _Together._frequency(SimpleNamespace(kinds=["dynamic"], recordings=[one]), 0, conditions)
    return conditions.values["frequency"]


def fixed(share):
    """Whether the far side may be fixed, by V2 over V1."""
    folder = MagicMock()
    with patch.object(together, "motion_share", lambda *given: share):
        _Together._far_side(folder, {"motion_in": FORCE, "motion_out": FORCE}, {})
    return folder._doubt.called


def preloads(mean):
    """Number of preloads of two recordings, by the mean of F1 of the second; that of the first is 1 kN."""
    shapes = [SimpleNamespace(means={"F1": each}, ranges={"F1": (each - 1, each + 1)}) for each in (1e3, mean)]
    folder = SimpleNamespace(_of_kind=lambda *kinds: [0, 1], recordings=[SimpleNamespace(shape=one) for one in shapes])
    return len({token.value for (token,) in _Together._mean_loads(folder, {"force_in": FORCE}).values()})


def turned(passive):
    """Whether a sensor is inverted, by the share of the tests that are passive then."""
    roles = {name: Role(name, name, "N", "force") for name in channels._SYMBOLS}
    shares = {"_stiffness": lambda roles, shapes: passive if roles["force_in"].invert else 0.1, "_passive": float}
    with patch.multiple(channels, **shares):
        return any(role.invert for role in channels._signs(roles, [None]).values())


def unit(kind, largest):
    """Unit of a static channel that states none, by its largest value."""
    columns = [Column("load", None, "force"), Column("deflection", None, "displacement")]
    shape = MagicMock(ranges=dict.fromkeys(("load", "deflection"), (0.0, largest)))
    return static_roles(columns, [shape])[kind].unit


def numbered(used=10, distinct=2):
    """Whether numbers are taken as those of specimens, by how many of ten tests have one, and how many differ."""
    values = [str(at % distinct) for at in range(used)] + [""] * (10 - used)
    parts = {"_known": lambda *given: False, "_splits": lambda *given: True, "_doubt_on": lambda *given, **how: ""}
    with patch.multiple(specimens, **parts), patch.object(specimens, "_add") as added:
        specimens._consider("serial", values, [(None, SimpleNamespace(tyre=""))] * 10)
    return added.called


def recorded(quantity, unit, mean):
    """Whether the mean of a recorded channel is a condition."""
    shape = SimpleNamespace(samples={"x": np.full(3, mean)})
    return len(list(_recorded((Column("x", unit, quantity),), shape))) == 1


#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "static recording, below 0.5 Hz": (lambda x: kind(x / 100.0), {0.495: "static", 0.505: "dynamic"}),
    "static recording without times, below 6 cycles": (
        lambda x: kind(x / 1000, rate=None, count=1000), {5.94: "static", 6.06: "dynamic"},
    ),
    "sine of a dynamic test, 40 % of the variance": (lambda x: kind(share=x), {0.396: "", 0.404: "dynamic"}),
    "sine that lasts, 30 % in every quarter": (lambda x: kind(first=x), {0.297: "", 0.303: "dynamic"}),
    "slow motion, below 2 Hz": (lambda x: slow((x, 1.0)), {1.9: True, 2.1: False}),
    "slow motion, 90 % of the variance": (
        lambda x: slow((1.0, x), (5.0, 1 - x)), {0.896: False, 0.904: True},
    ),
    "excitation of a band, 30 cycles": (excited, {2.97: None, 3.03: "random"}),
    "band that is wide, 1.5": (
        lambda x: signals._resolved((10.0, 10.0 * x), 1.0, 100.0) is not None, {1.49: False, 1.51: True},
    ),
    "sweep that lasts, 30 % of the recording": (
        lambda count: excited(parts=count, is_swept=True), {9: None, 10: "sweep"},
    ),
    "frequency that is stated, 5 %": (frequency, {10.49: 10.49, 10.51: 10.0, 9.51: 9.51, 9.49: 10.0}),
    "far side that may be fixed, 3 %": (fixed, {0.0297: True, 0.0303: False}),
    "means of F1 of one preload, 2 %": (preloads, {1020.0: 1, 1021.0: 2}),
    "K* over the static stiffness, 0.3 to 12": (
        lambda x: len(checked_force(FORCE, x).doubts), {0.297: 1, 0.303: 0, 11.9: 0, 12.1: 1},
    ),
    "tests that are passive with a sign turned, 90 %": (turned, {0.896: False, 0.904: True}),
    "load without a unit, N from 100 on": (lambda x: unit("load", x), {99.0: "kN", 101.0: "N"}),
    "deflection without a unit, mm from 0.5 on": (lambda x: unit("deflection", x), {0.495: "m", 0.505: "mm"}),
    "mass that is a load, from 50 kg on": (
        lambda text: read_name(text)[0].what, {"49.5 kg": "added_mass", "50.5 kg": "preload"},
    ),
    "numbers of specimens, in 80 % of the tests": (numbered, {7: False, 8: True}),
    "numbers of specimens, half as many as tests": (lambda x: numbered(distinct=x), {5: True, 6: False}),
    "pressure that is recorded, 0.3 to 20 bar": (
        lambda x: recorded("pressure", "Pa", x), {2.97e4: False, 3.03e4: True, 1.98e6: True, 2.02e6: False},
    ),
    "temperature that is recorded, -60 to 150 °C": (
        lambda x: recorded("temperature", "degC", x), {-60.6: False, -59.4: True, 149.0: True, 151.0: False},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
