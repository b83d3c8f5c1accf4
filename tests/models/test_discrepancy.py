"""What has to be granted: nothing where the data are met, else what makes chi-square right."""

import numpy as np
import pytest
from scipy import stats

from fourpole.models.data import StiffnessData
from fourpole.models.discrepancy import least_misfit, model_discrepancy, with_error
from fourpole.models.maxwell import Zener

pytestmark = pytest.mark.thorough

OMEGA = 2 * np.pi * np.geomspace(1.0, 100.0, 60)
CLEAN = Zener().stiffness([180e3, 120e3, 700.0], OMEGA)


def noisy(noise, seed):
    rng = np.random.default_rng(seed)
    return CLEAN + noise * np.abs(CLEAN) * (rng.standard_normal(60) + 1j * rng.standard_normal(60))


def test_nothing_is_granted_where_the_data_are_met():
    for seed in range(5):
        assert model_discrepancy([StiffnessData.of(OMEGA, noisy(1e-3, seed), 1e-3 * np.abs(CLEAN))]) == 0.0


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
@pytest.mark.sampled(3)
def test_an_unknown_noise_is_found(noise):
    """From 120 numbers less some five: known to 1/sqrt(2 · 115) = 7 %, so within three times that; 20 draws' mean."""
    found = [model_discrepancy([StiffnessData.of(OMEGA, noisy(noise, seed), 0.0)], always=True) for seed in range(20)]
    assert np.mean(found) == pytest.approx(noise, rel=0.1)
    assert np.all(np.abs(np.array(found) / noise - 1) < 0.3)


def test_what_is_granted_comes_on_top_of_what_is_known():
    """Noise of 1 % stated as 0.1 %: root of 1 % squared less 0.1 % squared."""
    found = model_discrepancy([StiffnessData.of(OMEGA, noisy(1e-2, 1), 1e-3 * np.abs(CLEAN))])
    assert found == pytest.approx(1e-2, rel=0.25)
    chi2, dof = least_misfit([with_error(StiffnessData.of(OMEGA, noisy(1e-2, 1), 1e-3 * np.abs(CLEAN)), found)])
    assert chi2 / dof == pytest.approx(1.0, abs=0.02)


def test_the_whole_covariance_is_kept():
    shared = np.stack([CLEAN.real, CLEAN.imag], axis=1).reshape(-1, 1) * 0.01
    data = StiffnessData.of(OMEGA, CLEAN, 1.0, shared=shared)
    more = with_error(data, 0.02)
    added = np.diagonal(more.covariance - data.covariance)
    np.testing.assert_allclose(added[::2], (0.02 * np.abs(CLEAN)) ** 2, rtol=1e-9)
    off = more.covariance - data.covariance - np.diag(added)
    assert np.abs(off).max() == 0
    assert with_error(data, 0.0) is data


def misfit_of(chi2, dof):
    """The misfit of a model on data of which the error is 1e-3: it falls as the error that is added grows."""

    def misfit(rows):
        added = float(np.sqrt(rows[0].covariance[0, 0, 0])) / np.abs(rows[0].stiffness[0])
        return chi2 / (1 + (added / 1e-3) ** 2), dof

    return misfit


EXACT = StiffnessData.of(OMEGA, CLEAN, 0.0)


@pytest.mark.parametrize(("factor", "fits"), [(0.999, True), (1.001, False)])
def test_there_is_none_down_to_a_chance_of_one_in_a_thousand(factor, fits):
    chi2 = factor * float(stats.chi2.isf(1e-3, 100))
    assert (model_discrepancy([EXACT], misfit_of(chi2, 100)) == 0.0) is fits


@pytest.mark.parametrize("chi2", [150.0, 1e3, 1e6])
def test_chi_square_is_its_degrees_of_freedom_within_one_per_cent(chi2):
    misfit = misfit_of(chi2, 100)
    found = model_discrepancy([EXACT], misfit, always=True)
    assert misfit([with_error(EXACT, found)])[0] / 100 == pytest.approx(1.0, abs=0.01)
    assert found == pytest.approx(1e-3 * np.sqrt(chi2 / 100 - 1), rel=0.02)


def test_it_is_never_more_than_all_of_the_stiffness_nor_less_than_single_precision():
    assert model_discrepancy([EXACT], lambda rows: (1e9, 100)) == pytest.approx(1.0, rel=0.02)
    assert model_discrepancy([EXACT], lambda rows: (1e-9, 100), always=True) == pytest.approx(1e-7, rel=0.02)
