"""The paper's rig on exact vectors (computed with 50 digits): every form of every formula, and the errata."""

import csv

import numpy as np
import pytest

from fourpole.core.identify import identify
from fourpole.core.phasor import Phasors
from fourpole.core.reduced import identify_mobility, identify_stiffness, predict
from fourpole.core.rig import Rig
from fourpole.core.routes import maxwell_arm, mobility_route, paper_d, relative_route, transmissibility_route
from fourpole.core.twoport import cascade, chain_mobility, chain_transmissibility, damper, deembed, mass, spring
from fourpole.core.tyre import (
    loss_factor,
    mobility,
    transmissibility,
    zener_mobility,
    zener_stiffness,
    zener_transmissibility,
)
from fourpole.report.selftest import cases

# The vectors are exact to 17 digits. The steepest of them, V1/F1 close to the resonance of tyre and rig, multiplies
# round-off by about 70 on the way to K2 and C: 70 · 2.2e-16 = 1.5e-14, and fewer than 50 operations lead there.
EXACT = 1e-12

NAMES = [
    "K1 [N/m]",
    "K2 [N/m]",
    "C [N s/m]",
    "m [kg]",
    "K3 [N/m]",
    "frequency [Hz]",
    "Re K* [N/m]",
    "Im K* [N/m]",
    "R [m/(N s)]",
    "I [m/(N s)]",
    "d [1]",
    "TR [1]",
    "arg(V2/V1) [rad]",
]

# fmt: off
QUOTED = np.array([
    [180e3, 120e3, 700.0, 15.0, 12440.0, 10.0, 194211.26530917299, 38773.596369347214,
     6.2114469491190663e-5, -0.001032080825614907, 0.89129967839041634, 1.2991008706046072, -0.060111219944259378],
    [180e3, 120e3, 700.0, 15.0, 12440.0, 20.0, 221943.35691114985, 57218.507848089502,
     0.00013687235797757729, -2.9012003202520185e-5, 0.76047337353923974, 4.0019245492547679, -1.3619238965828809],
    [180e3, 120e3, 700.0, 15.0, 12440.0, 24.0, 232347.75227567393, 59510.025245882282,
     0.0001559947972135263, 0.00015022666132729257, 0.72700910487632897, 2.1186301839573443, -2.3373602326083162],
    [120e3, 60e3, 600.0, 15.0, 12440.0, 10.0, 136982.59198050613, 27028.634602103318,
     8.7113545658508425e-5, -0.00090170691273487327, 0.84319561781468484, 1.4827193748339683, -0.09631070786923035],
    [120e3, 60e3, 600.0, 15.0, 12440.0, 16.0, 150158.86659478028, 29999.579353801995,
     0.00012862207411110026, -7.8627207329259811e-5, 0.76848026660001954, 4.7921907273803943, -1.0221063887708339],
    [165e3, 90e3, 1500.0, 22.5, 12440.0, 12.0, 220104.60269347637, 43850.849528908673,
     6.5641179117145805e-5, -0.00032348885415440612, 0.72102498875213033, 1.9782012715801214, -0.20019816804867967],
    [165e3, 90e3, 1500.0, 22.5, 12440.0, 24.0, 242699.11513521518, 30915.49561908949,
     7.7882621705347824e-5, 0.00030933396643045734, 0.66899885775227175, 0.94698310163653415, -2.8949439117879559],
])
# fmt: on


class Vectors:
    """The columns of the reference, and what follows from them without any function under test."""

    def __init__(self, rows):
        self.rows = rows
        self.k1, self.k2, self.c, self.m, self.k3, self.f, *rest = rows.T
        self.omega = 2 * np.pi * self.f
        self.stiffness = rest[0] + 1j * rest[1]
        self.mobility = rest[2] + 1j * rest[3]
        self.d, self.tr = rest[4:6]
        self.transmissibility = self.tr * np.exp(1j * rest[6])
        self.rig_impedance = 1j * self.omega * self.m + self.k3 / (1j * self.omega)
        self.constants = (self.k1, self.k2, self.c, self.omega)
        self.above = {"mass": self.m, "preload_stiffness": self.k3}

    def rigs(self):
        """Each rig of the table with the rows that stand on it."""
        for m, k3 in sorted(set(zip(self.m, self.k3, strict=True))):
            on_it = (self.m == m) & (self.k3 == k3)
            yield Rig(moving_mass=m, preload_stiffness=k3), Vectors(self.rows[on_it])


def packaged():
    """The rows of the paper's rig among the reference vectors of the package."""
    inputs = ("K1", "K2", "C", "m", "K3", "frequency")
    values = ("Re K*", "Im K*", "Re V1/F1", "Im V1/F1", "d", "TR", "arg(V2/V1)")
    rows = []
    for one in cases():
        if one["function"] == "core.tyre (the paper's rig)":
            expected = {row["value"]: float(row["expected"]) for row in one["values"]}
            rows.append([*(one["inputs"][name] for name in inputs), *(expected[name] for name in values)])
    assert len(rows) == 12
    return np.array(rows)


@pytest.fixture(scope="module", params=["quoted", "package", "file"])
def vectors(request):
    if request.param != "file":
        return Vectors(QUOTED if request.param == "quoted" else packaged())
    shared = request.getfixturevalue("shared")
    with (shared / "reference" / "zener-rig.csv").open(newline="") as file:
        names, *rows = csv.reader(file)
    assert names == NAMES
    table = np.array(rows, dtype=float)
    assert len(table) == 24
    return Vectors(table)


def exactly(found, expected):
    np.testing.assert_allclose(np.real(found), np.real(expected), rtol=EXACT)
    if np.iscomplexobj(expected):
        np.testing.assert_allclose(np.imag(found), np.imag(expected), rtol=EXACT)


def test_the_quoted_rows_are_those_of_the_file(shared):
    with (shared / "reference" / "zener-rig.csv").open(newline="") as file:
        rows = np.array(list(csv.reader(file))[1:], dtype=float)
    assert {tuple(row) for row in QUOTED} <= {tuple(row) for row in rows}


def test_closed_forms(vectors):
    exactly(zener_stiffness(*vectors.constants), vectors.stiffness)
    exactly(zener_mobility(*vectors.constants, **vectors.above), vectors.mobility)
    exactly(zener_transmissibility(*vectors.constants, **vectors.above), vectors.tr)


def test_from_the_dynamic_stiffness(vectors):
    exactly(mobility(vectors.stiffness, vectors.omega, **vectors.above), vectors.mobility)
    ratio = transmissibility(vectors.stiffness, vectors.omega, **vectors.above)
    exactly(np.abs(ratio), vectors.tr)
    exactly(np.angle(ratio), np.angle(vectors.transmissibility))
    exactly(loss_factor(vectors.stiffness), vectors.stiffness.imag / vectors.stiffness.real)


def test_the_product_of_the_matrices(vectors):
    tyre = spring(vectors.stiffness, vectors.omega)
    rig = cascade(mass(vectors.m, vectors.omega), spring(vectors.k3, vectors.omega))
    exactly(chain_mobility(cascade(tyre, rig)), vectors.mobility)
    ratio = chain_transmissibility(tyre, rig)
    exactly(np.abs(ratio), vectors.tr)
    exactly(np.angle(ratio), np.angle(vectors.transmissibility))


def test_the_tyre_is_k1_beside_a_cascade_of_k2_and_c(vectors):
    arm = cascade(spring(vectors.k2, vectors.omega), damper(vectors.c))
    beside = vectors.k1 + 1j * vectors.omega / arm[:, 1, 0]
    exactly(beside, vectors.stiffness)


def test_deembedding_the_rig_leaves_the_tyre(vectors):
    rig = cascade(mass(vectors.m, vectors.omega), spring(vectors.k3, vectors.omega))
    inner = deembed(cascade(spring(vectors.stiffness, vectors.omega), rig), after=rig)
    exactly(1j * vectors.omega / inner[:, 1, 0], vectors.stiffness)


def test_the_arm_and_the_papers_d(vectors):
    k2, c = maxwell_arm(vectors.stiffness, vectors.k1, vectors.omega)
    exactly(k2, vectors.k2)
    exactly(c, vectors.c)
    exactly(paper_d(vectors.stiffness, vectors.k1), vectors.d)


def test_the_three_routes(vectors):
    exactly(mobility_route(vectors.mobility, 1 / vectors.rig_impedance, vectors.omega), vectors.stiffness)
    exactly(transmissibility_route(vectors.transmissibility, vectors.rig_impedance, vectors.omega), vectors.stiffness)
    v1 = 0.06 * np.exp(0.3j)
    f1, v2 = v1 / vectors.mobility, v1 * vectors.transmissibility
    exactly(relative_route(f1, v1, v2, vectors.omega), vectors.stiffness)


@pytest.mark.parametrize("route", ["mobility", "relative", "transmissibility"])
def test_identify(vectors, route):
    for rig, rows in vectors.rigs():
        phasors = Phasors.from_polar(
            rows.f,
            0.06 / np.abs(rows.mobility),
            0.06,
            -np.angle(rows.mobility),
            0.06 * rows.tr,
            np.angle(rows.transmissibility),
        )
        found = identify(phasors, rig, rows.k1, route=route)
        exactly(found.mobility, rows.mobility)
        exactly(found.stiffness, rows.stiffness)
        exactly(found.k2, rows.k2)
        exactly(found.c, rows.c)
        exactly(found.tr_measured, rows.tr)
        exactly(found.tr_predicted, rows.tr)
        assert set(found.reasons) == {""}


def test_reduced_tables(vectors):
    for rig, rows in vectors.rigs():
        for found in (
            identify_mobility(rows.f, rows.mobility, rows.k1, rig),
            identify_stiffness(rows.f, rows.stiffness, rows.k1, rig),
        ):
            exactly(found.stiffness, rows.stiffness)
            exactly(found.mobility, rows.mobility)
            exactly(found.d, rows.d)
            exactly(found.k2, rows.k2)
            exactly(found.c, rows.c)
            exactly(found.tr, rows.tr)
        for row in rows.rows:
            one = Vectors(row[None, :])
            found = predict(one.f, row[0], row[1], row[2], rig)
            exactly(found.mobility, one.mobility)
            exactly(found.tr, one.tr)


def paper_11_to_13(vectors):
    """C, K2 and d by the paper's own eqs (11), (12) corrected, and (13), from its own measured quantities."""
    r, i = vectors.mobility.real, vectors.mobility.imag
    d = vectors.k1 * (i / vectors.omega - 1 / (vectors.k3 - vectors.m * vectors.omega**2))
    both = (vectors.k1 / vectors.omega) ** 2 + ((1 - d) / r) ** 2
    return r * both, vectors.k1 * both / (d * (1 - d) / r**2 - (vectors.k1 / vectors.omega) ** 2), d


def test_equations_11_to_13_corrected_are_the_maxwell_arm(vectors):
    c, k2, d = paper_11_to_13(vectors)
    by_compliance = maxwell_arm(vectors.stiffness, vectors.k1, vectors.omega)
    exactly(k2, by_compliance[0])
    exactly(c, by_compliance[1])
    exactly(d, paper_d(vectors.stiffness, vectors.k1))


def test_erratum_of_equation_8(vectors):
    k1, k2, c, omega = vectors.constants
    arm = (omega * c * (k1 + k2)) ** 2
    over = omega**2 * c * k2**2 + 1j * omega * (k1 * k2**2 + omega**2 * c**2 * (k1 + k2))
    rig = 1j * omega / (vectors.k3 - omega**2 * vectors.m)
    exactly(over / (k1**2 * k2**2 + arm) + rig, vectors.mobility)
    printed = over / (k1 * k2**2 + arm) + rig
    assert (np.abs(printed / vectors.mobility - 1) > 0.05).all()


def test_erratum_of_equation_12(vectors):
    _, k2, d = paper_11_to_13(vectors)
    r = vectors.mobility.real
    printed = (
        vectors.k1 * (vectors.k1 / vectors.omega + (1 - d) / r) / (d * (1 - d) / r - (vectors.k1 / vectors.omega) ** 2)
    )
    exactly(k2, vectors.k2)
    assert (np.abs(printed / vectors.k2 - 1) > 0.05).all()


def test_erratum_of_equation_14(vectors):
    k1, k2, c, omega = vectors.constants
    rig = vectors.k3 - vectors.m * omega**2

    def tr(above, below):
        return np.sqrt((k1**2 + above * (k1 + k2) ** 2) / ((k1 + rig) ** 2 + below * (k1 + k2 + rig) ** 2))

    exactly(tr((omega * c / k2) ** 2, (omega * c / k2) ** 2), vectors.tr)
    printed = tr(omega * c * k2, (omega * c * k2) ** 2)
    assert (np.abs(printed / vectors.tr - 1) > 0.05).all()


def test_erratum_of_the_text_above_equation_8(vectors):
    """The mobility is V1/F1, as eq. (1) defines it: F1/V1 is a thousand times off and of another unit."""
    assert (np.abs(1 / vectors.mobility) > 1e5 * np.abs(vectors.mobility)).all()
    stiff = zener_stiffness(*vectors.constants)
    exactly(1j * vectors.omega / stiff + 1 / vectors.rig_impedance, vectors.mobility)
