"""The operating map as xarray: coordinates, units, the hull, and the truth at a point between the tests."""

import numpy as np
import pytest
from tests.kept import kept

from fourpole.errors import ModelError
from fourpole.study import read_results
from fourpole.study.analysis import analyse
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign


def _analysed(folder):
    simulate_campaign(
        folder, pressures=[1.0e5, 1.7e5, 2.4e5], preloads=[1000.0, 2000.0], frequencies=[10.0, 14.0, 19.0, 24.0]
    )
    analyse(folder, monte_carlo=0).write(folder / "results")


@pytest.fixture(scope="module")
def study():
    return read_results(kept("grid", _analysed) / "results")


@pytest.mark.thorough
@pytest.mark.sampled(6)
def test_a_point_between_the_tests(study):
    found = study.map("zener", at={"pressure": [1.85e5, 3.0e5], "preload": 1400.0, "frequency": [13.7, 40.0]})
    assert dict(found.sizes) == {"tyre": 2, "pressure": 2, "preload": 1, "frequency": 2}
    for tyre in (CROSS_PLY, RADIAL_PLY):
        here = found.sel(tyre=tyre.name, pressure=1.85e5, frequency=13.7).squeeze()
        for name, law in (("K2", tyre.k2), ("C", tyre.c)):
            true = float(law(13.7, 1.85e5, 1400.0))
            assert abs(float(here[name]) - true) < 4 * float(here[f"u_{name}"])
        # the arms of these tyres are laws of the frequency, which no causal model has: the uncertainty is large
        assert 0 < float(here.u_K_storage) < float(here.K_storage)
        assert 0 < float(here.u_TR) < float(here.TR)
    assert found.K2.attrs["units"] == "N/m"
    assert found.u_K2.attrs["long_name"] == "standard uncertainty of K2"
    assert found.pressure.attrs["units"] == "Pa"
    outside = found.sel(pressure=3.0e5)
    assert np.isnan(outside.K_storage).all()
    assert np.isnan(found.sel(frequency=40.0).K_storage).all()


@pytest.mark.sampled(4)
def test_a_whole_grid_of_one_tyre_survives_a_file(study, tmp_path):
    import xarray

    found = study.map("zener", tyre=RADIAL_PLY.name)
    assert found.sizes["tyre"] == 1
    assert found.sizes["frequency"] == 31
    assert np.isfinite(found.K_storage).all()
    assert float(found.frequency[0]) == pytest.approx(10.0, rel=0.01)
    np.testing.assert_allclose(found.loss_factor, found.K_loss / found.K_storage)
    found.to_netcdf(tmp_path / "map.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "map.nc", engine="h5netcdf") as back:
        np.testing.assert_array_equal(back.K2, found.K2)


@pytest.mark.sampled(4)
def test_what_it_cannot(study):
    with pytest.raises(ModelError, match="no axis 'camber'"):
        study.map("zener", tyre=RADIAL_PLY.name, at={"camber": [1.0]})
    with pytest.raises(ModelError, match="no test of a specimen 'x'"):
        study.map("zener", tyre="x")


@pytest.mark.sampled(2)
def test_fit_from_the_study(study):
    fits = study.fit("zener")
    assert [one.tyre for one in fits] == [CROSS_PLY.name, RADIAL_PLY.name]
    assert len(fits[0].chosen.fits) == 6
    assert not any(verdict.possible for verdict in fits[0].verdicts)  # K2 and C by design, not by relaxation
