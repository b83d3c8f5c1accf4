"""Numbers that decide what a folder of recordings is guessed to be: a case just inside each, and one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from fourpole.errors import CampaignError
from fourpole.guess import conditions, gather, roles, signals, specimens, together
from fourpole.guess.gather import _recorded
from fourpole.guess.names import Token, read_name
from fourpole.guess.pattern import read_pattern
from fourpole.guess.roles import checked_force, static_roles
from fourpole.guess.signals import SignalShape
from fourpole.guess.together import _Together
from fourpole.words.heads import Column, Role

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
        _Together._far_side(folder, dict.fromkeys(("force_in", "motion_in", "motion_out"), FORCE), {})
    return folder._doubt.called


def preloads(mean):
    """Number of preloads of two recordings, by the mean of F1 of the second; that of the first is 1 kN."""
    shapes = [SimpleNamespace(means={"F1": each}, ranges={"F1": (each - 1, each + 1)}) for each in (1e3, mean)]
    folder = SimpleNamespace(_of_kind=lambda *kinds: [0, 1], recordings=[SimpleNamespace(shape=one) for one in shapes])
    return len({token.value for (token,) in _Together._mean_loads(folder, {"force_in": FORCE}).values()})


def turned(passive):
    """Whether a sensor is inverted, by the share of the tests that are passive then."""
    given = {name: Role(name, name, "N", "force") for name in roles.SYMBOLS}
    shares = {"_stiffness": lambda given, shapes: passive if given["force_in"].invert else 0.1, "_passive": float}
    with patch.multiple(roles, **shares):
        return any(role.invert for role in roles._signs(given, [None]).values())


def unit(kind, largest):
    """Unit of a static channel that states none, by its largest value."""
    columns = [Column("load", None, "force"), Column("deflection", None, "displacement")]
    shape = SignalShape("static", 0.1, None, ranges=dict.fromkeys(("load", "deflection"), (0.0, largest)))
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


def meaning(key="", *, stated=()):
    """A function that gives the condition that a number is and the SI value of 1, by the letters before it."""
    entry = SimpleNamespace(kind="dynamic", frequency=np.nan, name=[Token(what, "", 1.0) for what in stated])

    def decided(value):
        token = Token("number", str(value), value, (key,) if key else (), key)
        found = conditions._meaning({0: token}, [entry])
        return found and (found.what, found.scale)

    return decided


def of_a_tyre(value):
    """Whether a number may be that of a tyre, in the doubt on it."""
    token = Token("number", str(value), value, ("pressure",), "p")
    entry = SimpleNamespace(parts=[("name", [token]), ("header", []), ("folder", [])])
    taken = {"replace": lambda one, **changed: changed.get("doubt", changed.get("name"))}
    with patch.multiple(conditions, **taken):
        (doubt,) = conditions._with(entry, {(): token}, {(): conditions._Meaning("pressure", 1e3, "taken as kPa")})
    return "number of a specimen" in doubt


def listed(count):
    """Whether a folder of so many files is taken."""
    names = [str(at) for at in range(count)]
    parts = {"_trouble": lambda *given: "", "_counting": len}
    with patch.multiple(gather, **parts), patch.object(gather.os, "walk", lambda folder: [(".", [], names)]):
        try:
            return len(gather._paths(gather.Path(), MagicMock())) == count
        except CampaignError:
            return False


def read_pattern_or_none(text):
    try:
        return read_pattern(text)
    except CampaignError:
        return None


def band(shoulder=0.0, floor=0.0, gap=0):
    """Lowest frequency [Hz] of a motion with power from 50 Hz on, by the power below it, and by a gap at 60 Hz."""
    power = np.full(400, floor)
    power[49:100], power[29:49] = 1.0, np.maximum(floor, shoulder)
    power[59 : 59 + gap] = 0.0
    lines = np.sqrt(power) * np.ones((1, 3, 1))
    parts = {"starts_of": lambda *given: np.zeros(3, int), "lines_of": lambda *given: lines}
    parts |= {"bins_of": lambda *given: (np.arange(1.0, 401.0), None)}
    track = SimpleNamespace(time=np.zeros(16500), rate=1e4, present=None, signals=None)
    with patch.multiple(signals.average, **parts):
        return signals._band(track, 0)


def moving(quantity):
    """A function that gives the unit of a dynamic channel that states none, by its amplitude."""

    def decided(size):
        shape = SimpleNamespace(amplitudes={"x": size})
        return roles._dynamic_role("force_in", Column("x", None, quantity), [shape]).unit

    return decided


def evidence(ratios=(1.0, 1.0), hertz=(10.0, 11.2)):
    """What two tests show of a force, and of two motions whose velocities have these ratios."""
    columns = [Column("F", "N", "force"), Column("a", "m/s", "velocity"), Column("b", "m/s", "velocity")]
    shapes = [
        SignalShape("dynamic", f, None, {"F": 1j, "a": ratio + 0j, "b": 1 + 0j}, dict.fromkeys("Fab", (-1.0, 1.0)))
        for f, ratio in zip(hertz, ratios, strict=True)
    ]
    return roles._Evidence(columns, shapes), columns


def twins(ratio):
    """Whether two motions are of one point, by the ratio of their velocities."""
    found, (_, a, b) = evidence((1.0, ratio))
    return found.is_twin(a, b)


def clipped(share):
    """Whether a channel is clipped, by the share of its samples at the ends of its range."""
    samples = np.linspace(-0.9, 0.9, 2000)
    samples[: round(2000 * share)] = 1.0
    return roles._is_clipped(SignalShape("dynamic", 10.0, None, samples={"x": samples}), "x")


def followed(correlation):
    """Whether a deflection is inverted for its slope, by the correlation with the load."""
    columns = [Column("load", "N", "force"), Column("deflection", "mm", "displacement")]
    with patch.object(roles, "_loop", lambda *given: (0.0, abs(correlation), correlation)):
        return static_roles(columns, [])["deflection"].invert


def massive(exponent, hertz=(10.0, 20.0)):
    """Exponent that a mass explains, of |K*| over frequency."""
    omega = np.array(hertz)
    return round(evidence(hertz=hertz)[0]._slope(omega**exponent), 3)


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
    "motions of one point, 5 %": (twins, {0.951: True, 0.949: False, -1.049: False, 1.049: True, 1.051: False}),
    "clipped channel, 15 % at the ends": (clipped, {0.148: False, 0.152: True}),
    "slope of load over deflection, correlation 0.5": (
        followed, {-0.49: False, -0.51: True, 0.51: False},
    ),
    "exponent of |K*| without a mass, 0 to 0.5": (massive, {-0.01: 0.01, 0.0: 0.0, 0.49: 0.0, 0.51: 0.01, 9.0: 3.0}),
    "range of frequencies with an exponent, 0.1 in logarithm": (
        lambda high: massive(-1.0, (10.0, high)), {11.04: 0.0, 11.06: 1.0},
    ),
    "load without a unit, N from 100 on": (lambda x: unit("load", x), {99.0: "kN", 101.0: "N"}),
    "deflection without a unit, mm from 0.5 on": (lambda x: unit("deflection", x), {0.495: "m", 0.505: "mm"}),
    "force without a unit, N from 1 on": (moving("force"), {0.99: "kN", 1.01: "N"}),
    "velocity without a unit, mm/s from 3 on": (moving("velocity"), {2.97: "m/s", 3.03: "mm/s"}),
    "displacement without a unit, mm from 0.02 on": (moving("displacement"), {0.0198: "m", 0.0202: "mm"}),
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
    "pressure by its letters, 0.3 to 10 bar": (
        meaning("pressure"), {0.297: None, 0.303: ("pressure", 1e5), 9.0: ("pressure", 1e5), 11.0: ("pressure", 1e4)},
    ),
    "pressure by its letters, tenths to 99.9 and kPa to 999": (
        meaning("pressure"),
        {99.8: ("pressure", 1e4), 99.95: None, 101.0: ("pressure", 1e3), 998.0: ("pressure", 1e3), 1001.0: None},
    ),
    "pressure without letters, 0.3 to 10 bar and 100 to 450 kPa": (
        meaning(), {0.297: None, 0.303: ("pressure", 1e5), 9.9: ("pressure", 1e5), 10.1: None, 99.0: None,
                    101.0: ("pressure", 1e3), 449.0: ("pressure", 1e3), 451.0: ("preload", 1.0)},
    ),
    "preload without letters, 300 to 50 000 N": (
        meaning(stated=["pressure"]),
        {297.0: None, 303.0: ("preload", 1.0), 49900.0: ("preload", 1.0), 50100.0: None},
    ),
    "preload by its letters, N from 50 on": (
        meaning("preload"), {49.5: ("preload", 1e3), 49.95: None, 49.0: None, 50.5: ("preload", 1.0)},
    ),
    "temperature by its letters, 10 to 90 °C": (
        meaning("temperature"), {9.9: None, 10.1: ("temperature", 1.0), 89.1: ("temperature", 1.0), 90.9: None},
    ),
    "mass by its letters, up to 100 kg": (meaning("added_mass"), {99.0: ("added_mass", 1.0), 101.0: None}),
    "amplitude by its letters, below 50 mm": (meaning("amplitude"), {49.4: ("amplitude", 1e-3), 50.4: None}),
    "number that may be of a tyre, below 100": (of_a_tyre, {99.0: True, 101.0: False}),
    "files of a folder, 20 000": (listed, {20_000: True, 20_001: False}),
    "characters of a name, 400": (
        lambda n: read_name("a" * n + " 5 bar")[0].what, {390: "pressure", 401: "word"},
    ),
    "characters of a pattern, 400": (
        lambda n: read_pattern_or_none("{specimen}" + "a" * (n - 10)) is not None, {400: True, 401: False},
    ),
    "word with a number that is a state, more than 3 letters": (
        specimens._of_state, {"low2": False, "slip2": True},
    ),
    "specimens that are listed, 5": (lambda n: "..." in specimens._listed(["a"] * n), {5: False, 6: True}),
    "power of a band, 1e-4 of the largest": (lambda x: band(x)[0], {0.99e-4: 52.0, 1.01e-4: 32.0}),
    "power of a band, 10 times the floor": (lambda x: band(1e-3 * x, 1e-3)[0], {9.9: 52.0, 10.1: 32.0}),
    "gap in a band, 3 bins": (lambda n: band(gap=n)[0], {2: 52.0, 3: 65.0}),
    "lowest frequency of a band, 1.01 of what is resolved": (
        lambda x: signals._resolved((0.1, 100.0), x, 1.0)[0], {1.0: 1.1, 2.0: 2.1, 4.0: 4.1},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
