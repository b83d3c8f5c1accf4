"""Where nobody states the uncertainty of K*: 95 % intervals by the residuals of the model, or a refusal."""

import numpy as np
import pytest

from fourpole.errors import ModelError
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelling import fit_tyres

NOISE, SPACE = 0.005, np.array([10.3, 13.7, 19.1])


def kelvin(w):
    return 2e5 + 300j * w


def zener(w):
    return 180e3 + 1j * w * 700 * 120e3 / (120e3 + 1j * w * 700)


def fitted(folder, specimen, count, seed, model):
    hertz = np.linspace(8.0, 24.0, count)
    rng = np.random.default_rng([11, seed])
    k = specimen(2 * np.pi * hertz)
    k = k + NOISE * np.abs(k) * (rng.normal(size=count) + 1j * rng.normal(size=count))
    table = folder / "k.csv"
    rows = (f"{one},{value.real:.17g},{value.imag:.17g}" for one, value in zip(hertz, k, strict=True))
    table.write_text("\n".join(["frequency [Hz],Re K* [N/m],Im K* [N/m]", *rows]))
    (found,) = fit_tyres(read_measured(table), model)
    return found.chosen.fit


def inside(fit, specimen):
    """Whether K' and K'' of the truth between the tested frequencies lie in the 95 % intervals, (6,)."""
    w, values, model = 2 * np.pi * SPACE, fit.values, fit.model
    size = 1e-4 * values
    slopes = np.stack([(model.stiffness(values + one, w) - model.stiffness(values - one, w)) / (2 * one.sum())
                       for one in np.diag(size)], axis=1)  # fmt: skip
    off = model.stiffness(values, w) - specimen(w)
    parts = [(off.real, slopes.real), (off.imag, slopes.imag)]
    return np.concatenate(
        [np.abs(error) < 1.96 * np.sqrt(np.einsum("ni,ij,nj->n", by, fit.covariance, by)) for error, by in parts]
    )


@pytest.mark.parametrize(
    ("specimen", "model", "count"), [(kelvin, "kelvin", 3), (zener, "zener", 3), (zener, "zener", 4)]
)
@pytest.mark.sampled(4)
def test_few_rows_without_an_uncertainty_have_intervals_that_hold(tmp_path, specimen, model, count):
    """88 % at least; 40 draws, whose six numbers depend on three parameters, show 80 % in one of 1,000 trials."""
    found = [inside(fitted(tmp_path, specimen, count, seed, model), specimen) for seed in range(40)]
    assert np.mean(found) > 0.8


def test_too_few_rows_are_refused_with_what_to_state(tmp_path):
    with pytest.raises(ModelError, match=r"cannot be found from these data: zener has 1 numbers more .* State --std"):
        fitted(tmp_path, zener, 2, 0, "zener")


def test_the_sentence_is_of_the_model_that_is_taken(tmp_path):
    """Of two rows a spring is the only model that leaves three degrees of freedom, whatever the BIC of others."""
    table = tmp_path / "two.csv"
    table.write_text("frequency [Hz],Re K* [N/m],Im K* [N/m]\n5,200000,9000\n15,205000,12000\n")
    (found,) = fit_tyres(read_measured(table))
    assert found.chosen.name == "spring"
    assert found.choice.text.startswith("spring: 1 parameter, ")


@pytest.mark.parametrize(
    ("head", "u", "said"),
    [
        (",u(Re K*) [N/m],u(Im K*) [N/m]", ",0,0", "are zero in every row"),
        (",u(Re K*) [N/m]", ",1000", "'u(Im K*) [N/m]' has no value"),
        (",u(Im K*) [N/m]", ",1000", "'u(Re K*) [N/m]' has no value"),
    ],
)
def test_an_uncertainty_of_zero_or_of_one_part_is_none(tmp_path, head, u, said):
    table = tmp_path / "k.csv"
    rows = "".join(f"{f},{200000 + 900 * f},{9000 + 300 * f}{u}\n" for f in range(5, 25, 5))
    table.write_text(f"frequency [Hz],Re K* [N/m],Im K* [N/m]{head}\n{rows}")
    found = read_measured(table)
    assert not found.known
    assert said in found.notes[1]
    assert "states no uncertainty" in found.notes[2]
