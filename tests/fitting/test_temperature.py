"""A model file holds the shift factors found: queries at the isotherms give what was measured there, law or no law."""

import json
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import scipy
from tests.models.isotherms import fractional_zener, isotherm, log_a

from fourpole.app.group import show
from fourpole.app.options import ShiftOptions
from fourpole.app.tables import run_shift
from fourpole.errors import FourpoleError, ModelError
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.fitting.shifting import laws_beside, read_isotherms, shift_tyres
from fourpole.io.door import sha256_of

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
T, NOISE = (-10.0, -4.0, 2.0, 8.0, 14.0, 20.0, 30.0, 40.0, 50.0), 0.01
HERTZ = "frequency [Hz]"


def two_branches(t):
    """ln aT with a kink at 15 degC, which neither WLF nor Arrhenius has."""
    t = np.asarray(t, dtype=float)
    return np.log(10) * np.where(t >= 15, -0.08 * (t - 20), 0.4 + 0.25 * (15 - t))


def written(path, temperatures, shift, *, seed=4, points=13):
    """A table of isotherms of a fractional Zener solid."""
    rng, parts = np.random.default_rng(seed), []
    for t in temperatures:
        one = isotherm(t, int(rng.integers(2**32)), NOISE, shift=shift, points=points)
        columns = {HERTZ: one.frequency, "Re K* [N/m]": one.stiffness.real, "Im K* [N/m]": one.stiffness.imag}
        parts.append(pl.DataFrame({**columns, "temperature [degC]": [t] * points}))
    pl.concat(parts).write_csv(path)
    return path


def modelled(table, folder, reference, *, vertical=False):
    """The model file of isotherms: fourpole shift, then fourpole fit."""
    show(run_shift([table], ShiftOptions(reference=reference, vertical=vertical, folder=folder)), as_json=True)
    master = folder / "master.csv"
    measured = read_measured(master)
    laws, note = laws_beside(master, sha256_of(master, max_bytes=10**7, label="master.csv"))
    assert not note
    model_file(measured, fit_tyres(measured), laws=laws).write(folder / "model.json")
    return read_model_file(folder / "model.json")


def answered(model, frequency, t, **more):
    rows = ask(model, Query(frequency.tolist(), {"temperature [degC]": t}, **more))
    value = np.array([row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"] for row in rows])
    return value, np.array([[row["u(Re K*) [N/m]"], row["u(Im K*) [N/m]"]] for row in rows]), rows[0]["remarks"]


@pytest.fixture(scope="module")
def branched(tmp_path_factory):
    folder = tmp_path_factory.mktemp("branched")
    return modelled(written(folder / "isotherms.csv", T, two_branches), folder / "master", 20.0)


def rms(off):
    return float(np.sqrt(np.mean(np.abs(off) ** 2)))


@pytest.mark.sampled(6)
def test_at_each_isotherm_the_answer_is_nearer_the_truth_than_the_noise(branched):
    frequency, z = np.geomspace(0.1, 50.0, 13), []
    for t in T:
        found, std, remarks = answered(branched, frequency, t)
        truth = fractional_zener(2 * np.pi * frequency * np.exp(two_branches(t)))
        assert rms(found / truth - 1) < NOISE
        assert "beyond" not in remarks
        z += [(found - truth).real / std[:, 0], (found - truth).imag / std[:, 1]]
    assert rms(np.concatenate(z)) < 1.2


@pytest.mark.sampled(2)
def test_between_isotherms_of_either_branch_the_intervals_hold(branched):
    frequency, z = np.geomspace(0.2, 20.0, 7), []
    for t in (-7.0, -1.0, 5.0, 11.0, 17.0, 25.0, 35.0, 45.0):
        found, std, _ = answered(branched, frequency, t)
        truth = fractional_zener(2 * np.pi * frequency * np.exp(two_branches(t)))
        z += [(found - truth).real / std[:, 0], (found - truth).imag / std[:, 1]]
    assert np.mean(np.abs(np.concatenate(z)) < 1.96) > 0.9


def test_beyond_the_isotherms_the_law_continues_them_and_is_named(branched):
    ten = np.array([10.0])
    with pytest.raises(ModelError, match="outside the isotherms"):
        answered(branched, ten, 60.0)
    end, end_std, _ = answered(branched, ten, 50.0)
    near, near_std, remarks = answered(branched, ten, 50.001)
    assert near == pytest.approx(end, rel=1e-4)
    assert near_std == pytest.approx(end_std, rel=1e-3)
    assert not remarks or "beyond the tested" not in remarks
    _, far_std, remarks = answered(branched, ten, 60.0, beyond=True)
    assert "beyond the tested -10 to 50 °C: by the " in remarks
    assert "law, which misses the shift found at" in remarks
    assert np.all(far_std > end_std)


@pytest.mark.sampled(2)
def test_shift_warns_once_where_the_law_misses_its_own_factors(tmp_path, capsys):
    show(run_shift([written(tmp_path / "t.csv", T, two_branches)], ShiftOptions(reference=20.0)), as_json=False)
    said = " ".join(capsys.readouterr().err.split())
    assert said.count("misses the shift factors found, at worst by") == 1
    assert "decades at" in said
    show(run_shift([written(tmp_path / "wlf.csv", T, log_a)], ShiftOptions(reference=20.0)), as_json=False)
    assert "misses the shift factors" not in capsys.readouterr().err


def test_a_query_without_a_temperature_is_at_the_reference(branched):
    far = np.array([1e-3, 10.0])
    found, std, _ = answered(branched, far, 20.0)
    rows = ask(branched, Query(far.tolist()))
    assert [row["Re K* [N/m]"] for row in rows] == pytest.approx(found.real)
    assert [row["u(Re K*) [N/m]"] for row in rows] == pytest.approx(std[:, 0])


def test_at_an_isotherm_the_error_of_its_shift_cancels(branched):
    """The curve there was moved by the same error; a file that does not know so counts the error twice."""
    entry = branched.models[0]
    shifts = entry.temperature.shifts.model_copy(update={"sensitivity_a": []})
    blind = entry.model_copy(update={"temperature": entry.temperature.model_copy(update={"shifts": shifts})})
    _, std, _ = answered(branched, np.array([1.0, 10.0]), 50.0)
    _, larger, _ = answered(branched.model_copy(update={"models": [blind]}), np.array([1.0, 10.0]), 50.0)
    assert np.all(std < larger)
    assert std[1, 0] < 0.8 * larger[1, 0]


def test_a_file_without_the_factors_found_answers_by_its_law(branched):
    entry = branched.models[0]
    old = entry.temperature.model_copy(update={"shifts": None})
    law, file = old.shift_law, branched.model_copy(update={"models": [entry.model_copy(update={"temperature": old})]})
    assert "shifts" not in file.document["models"][0]["temperature"]
    (row,) = ask(file, Query([10.0], {"temperature [degC]": 40.0}, beyond=True))
    assert row["reduced frequency [Hz]"] == pytest.approx(10.0 * np.exp(law.log_a(40.0)[0]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda shifts: shifts["temperatures"].reverse(), "do not rise"),
        (lambda shifts: shifts["log10_a"].pop(), "8 factors for 9 temperatures"),
        (lambda shifts: shifts["covariance_a"][0].__setitem__(1, 1e9), "covariance"),
        (lambda shifts: shifts["sensitivity_a"].pop(), "derivatives"),
    ],
)
def test_factors_that_were_changed_are_refused(branched, tmp_path, change, message):
    document = branched.document
    change(document["models"][0]["temperature"]["shifts"])
    (tmp_path / "model.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ModelError, match=message):
        read_model_file(tmp_path / "model.json")


def passive(omega, k):
    """The best passive K*, by non-negative least squares on a dense grid, each point relative to its modulus."""
    tau = np.append(np.logspace(-np.log10(omega.max()) - 2, -np.log10(omega.min()) + 2, 400), np.inf)
    arm = 1j * omega[:, None] * np.where(np.isfinite(tau), tau, 1.0)
    terms = np.where(np.isfinite(tau), arm / (1 + arm), 1.0)
    rows = np.concatenate([terms.real, terms.imag]) / np.tile(np.abs(k), 2)[:, None]
    size = np.linalg.norm(rows, axis=0)
    found, _ = scipy.optimize.nnls(rows / size, np.concatenate([k.real, k.imag]) / np.tile(np.abs(k), 2), maxiter=10**5)
    return terms @ (found / size)


def reproduces(table, folder):
    """Whether queries at isotherms are as near the measured values as the best passive K* of the master curve."""
    vertical = any(one.found.needs_vertical for one in shift_tyres(read_isotherms([table])))
    model = modelled(table, folder, None, vertical=vertical)
    master = pl.read_csv(folder / "master.csv")
    k = master["Re K* [N/m]"].to_numpy() + 1j * master["Im K* [N/m]"].to_numpy()
    omega = 2 * np.pi * master[HERTZ].to_numpy()
    best = passive(omega, k)
    scatter = rms(best / k - 1)
    low, high = model.models[0].temperature.range
    for one in read_isotherms([table]).conditions:
        t = one.state["temperature [degC]"]
        if low <= t <= high:
            found, _, _ = answered(model, one.frequency, t)
            own = np.isclose(master["measured temperature [degC]"].to_numpy(), t)
            assert rms(found / one.own.stiffness - 1) < 1.1 * rms((best / k - 1)[own]) + 0.2 * scatter, t
    entry = model.models[0]
    fitted, _, _ = answered(model, omega / (2 * np.pi), entry.temperature.reference)
    assert rms(fitted / best - 1) < 0.02
    return True


@pytest.mark.sampled(6)
def test_a_simulated_specimen_is_reproduced_within_its_own_scatter(tmp_path):
    assert reproduces(written(tmp_path / "t.csv", T, two_branches, seed=9), tmp_path / "master")


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real files are not here")
def test_public_isotherms_are_reproduced_within_their_own_scatter(tmp_path):
    done = 0
    for at, path in enumerate(sorted(one for one in SHARED.rglob("*") if one.is_file())):
        try:
            several = len(read_isotherms([path]).conditions) > 2
        except FourpoleError:  # a file of another kind
            continue
        done += several and reproduces(path, tmp_path / str(at))
    if not done:
        pytest.skip("no file there holds isotherms")


@pytest.mark.sampled(4)
def test_a_master_curve_of_206_points_takes_seconds(tmp_path):
    table = written(tmp_path / "t.csv", np.linspace(-10, 65, 21), log_a, points=10)
    begun = time.process_time()
    modelled(table, tmp_path / "master", None)
    assert time.process_time() - begun < 8.0
