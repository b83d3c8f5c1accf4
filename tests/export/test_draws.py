"""Draws of an FMU: they scatter as K* of the model is uncertain, and a simulator takes them by a number."""

import numpy as np
import pytest
from tests.export.fmus import DRAW, INPUTS, Instance, compiler, unpacked

from fourpole.core.specimen import Form, Specimen
from fourpole.export.fmi import _point, draws_in, write
from fourpole.export.systems import systems_of
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.query import Query, ask

HERTZ = np.array([8.0, 11.0, 15.0, 20.0, 24.0])


def fitted(model):
    import polars as pl

    hertz, rng = np.linspace(8.0, 24.0, 12), np.random.default_rng(5)
    truth = 2e5 * (2j * np.pi * hertz / 60) ** 0.08
    k = truth + 0.01 * np.abs(truth) * (rng.normal(size=12) + 1j * rng.normal(size=12))
    heads = ("frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]")
    frame = pl.DataFrame(dict(zip(heads, (hertz, k.real, k.imag), strict=True)))
    measured = measured_of(frame.with_columns(tyre=pl.lit("a")), std=0.01)
    return model_file(measured, fit_tyres(measured, model))


@pytest.mark.parametrize("model", ["zener", "maxwell:2", "fractional", "prony:1"])
@pytest.mark.sampled(4)
def test_draws_scatter_as_k_of_the_model_is_uncertain(model):
    file = fitted(model)
    (system,), _ = systems_of(file)
    drawn = _point(system).draws
    assert len(drawn) == 64
    k = np.array([one.stiffness(2 * np.pi * HERTZ) for one, _ in drawn])
    rows = ask(file, Query(frequency=HERTZ.tolist()))
    for part, head in ((k.real, "u(Re K*) [N/m]"), (k.imag, "u(Im K*) [N/m]")):
        ratio = part.std(axis=0) / np.array([row[head] for row in rows])
        # 64 draws show a standard deviation to 9 %; terms that are not negative hold some of them back.
        assert np.all((ratio > 0.6) & (ratio < 1.35)), ratio


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("belt", [None, Specimen(Form.BELT, 7.0, 0.2)])
@pytest.mark.sampled(4)
def test_a_draw_is_chosen_by_its_number(tmp_path, version, belt):
    pytest.importorskip("fmpy", reason="FMPy needs a later numpy than the lowest version allowed")
    compiler()
    file = fitted("maxwell:2")
    notes = write(file, tmp_path / "tyre.fmu", belt=belt, version=version)
    assert not [one for one in notes if "draws" in one]
    folder = unpacked(tmp_path / "tyre.fmu", tmp_path / "unpacked")
    (system,), _ = systems_of(file, belt=belt)
    point = _point(system)
    assert draws_in([point]) == 64
    forces = {}
    for draw in (0, 1, 64):
        one = Instance(folder, version, identifier="a")
        one.setup()
        one._choose([DRAW], [draw])
        one.put(INPUTS, [1e-3, 0.0, 0.0, 0.0])
        one.it.exitInitializationMode()
        one.step(0.0, 1e-9)
        forces[draw] = one.force
    if belt is None:
        rest = {0: system.realised.rest, 1: point.draws[0][0].rest, 64: point.draws[63][0].rest}
        for draw, force in forces.items():
            assert force == pytest.approx(1e-3 * rest[draw], rel=1e-9)
    assert len(set(forces.values())) == 3
