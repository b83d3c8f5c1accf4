"""Prony series for FE programs, read back by parsers of their layouts: the same K*, to the digits of the layout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.export.fe import read_abaqus, read_ansys, read_dyna, relaxing

from fourpole.errors import CampaignError, ModelError
from fourpole.export import export_results
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import ModelFile, read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.models.families import model_named
from fourpole.models.shape import Shape

FREQUENCY = np.geomspace(1e-3, 1e3, 25)
OMEGA = 2 * np.pi * FREQUENCY
BLOCK = Shape("shear", 0.01, 5e-4, poisson=0.49)
DISC = Shape("compression", 0.02, np.pi * 0.01**2, poisson=0.499, bonded="disc", bonded_factor=0.9)


def made(name: str, shape: Shape | None = None, tyres=("mount",)) -> ModelFile:
    """A model of a fractional rubber at two temperatures, of which K* at rest is a hundredth of that at once."""
    rows = []
    for tyre in tyres:
        for warm in (0.0, 40.0):
            k = model_named("fractional").stiffness([1e5, 1e7, 1e-2 * 10 ** (-warm / 20), 0.5], OMEGA)
            rows += [
                {"tyre": tyre, "temperature [degC]": warm, "frequency [Hz]": f, "Re K* [N/m]": one.real}
                | {"Im K* [N/m]": one.imag}
                for f, one in zip(FREQUENCY, k, strict=True)
            ]
    measured = measured_of(pl.DataFrame(rows), std=0.01)
    return model_file(measured, fit_tyres(measured, name), shapes=dict.fromkeys(tyres, shape) if shape else None)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Model files: with a shape in shear, in compression, and without one."""
    folder = tmp_path_factory.mktemp("models")
    plain = made("prony:2")
    for name, shape in (("plain", None), ("shear", BLOCK), ("compression", DISC)):
        entries = [one.model_copy(update={"shape": shape}) for one in plain.models]
        plain.model_copy(update={"models": entries}).write(folder / f"{name}.json")
    return folder


def stiffness(path, at=0):
    """K* of a condition of a model file."""
    entry = read_model_file(path).models[0]
    model = model_named(entry.model).with_parameters(len(entry.parameters))
    return model.stiffness(entry.conditions[at].values, OMEGA)


@pytest.mark.sampled(4)
def test_a_shape_goes_through_the_model_file(two):
    assert read_model_file(two / "plain.json").models[0].shape is None
    assert "shape" not in (two / "plain.json").read_text(encoding="utf-8")
    assert read_model_file(two / "compression.json").models[0].shape == DISC


@pytest.mark.parametrize(("name", "shape"), [("shear", BLOCK), ("compression", DISC)])
@pytest.mark.sampled(2)
def test_abaqus_gives_the_same_stiffness(two, name, shape, tmp_path):
    exported = export_results(two / f"{name}.json", "abaqus", tmp_path / "a.inp")
    assert exported.notes == ()
    materials = read_abaqus(exported.path.read_text(encoding="ascii"))
    assert list(materials) == ["MOUNT_1", "MOUNT_2"]
    for at, one in enumerate(materials.values()):
        young, poisson = one["elastic"]
        g, k, tau = np.array(one["terms"]).T
        assert np.array_equal(k, g if name == "compression" else 0 * g)
        whole = young if name == "compression" else young / (2 * (1 + poisson))
        modulus = relaxing(OMEGA, whole * (1 - g.sum()), whole * g, tau)
        assert np.abs(modulus / shape.modulus / stiffness(two / f"{name}.json", at) - 1).max() < 1e-9


@pytest.mark.parametrize(("name", "shape"), [("shear", BLOCK), ("compression", DISC)])
def test_ansys_gives_the_same_stiffness(two, name, shape, tmp_path):
    exported = export_results(two / f"{name}.json", "ansys", tmp_path / "a.mac")
    materials = read_ansys(exported.path.read_text(encoding="ascii"))
    assert [materials[at]["TEMP"] for at in (1, 2)] == [0.0, 40.0]
    for at, one in materials.items():
        share, tau = one["SHEAR"][::2], one["SHEAR"][1::2]
        assert ("BULK" in one) == (name == "compression")
        whole = one["EX"] if name == "compression" else one["EX"] / (2 * (1 + one["PRXY"]))
        modulus = relaxing(OMEGA, whole * (1 - share.sum()), whole * share, tau)
        assert np.abs(modulus / shape.modulus / stiffness(two / f"{name}.json", at - 1) - 1).max() < 1e-9


def test_dyna_gives_the_same_stiffness(two, tmp_path):
    exported = export_results(two / "compression.json", "lsdyna", tmp_path / "a.k")
    assert exported.notes == ("the density is not known to Fourpole: set RO of each *MAT_GENERAL_VISCOELASTIC",)
    blocks = read_dyna(exported.path.read_text(encoding="ascii"))
    assert [name for name, _ in blocks] == ["MAT_GENERAL_VISCOELASTIC"] * 2
    for at, (_, (head, curves, *terms)) in enumerate(blocks):
        assert head[0] == str(at + 1)
        assert set(curves) <= {""}
        assert len(terms) <= 18
        g, beta, bulk, beta_bulk = np.array(terms, dtype=float).T
        assert np.array_equal(beta, beta_bulk)
        assert beta[0] == 0.0
        shear = relaxing(OMEGA, g[0], g[1:], 1 / beta[1:])
        volume = relaxing(OMEGA, bulk[0], bulk[1:], 1 / beta[1:])
        young = 9 * volume * shear / (3 * volume + shear)
        assert np.abs(young / DISC.modulus / stiffness(two / "compression.json", at) - 1).max() < 1e-9
        assert float(head[2]) == pytest.approx(bulk.sum(), rel=1e-12)


def test_dyna_springs_are_the_stiffness_itself(two, tmp_path):
    exported = export_results(two / "plain.json", "lsdyna-springs", tmp_path / "a.k")
    blocks = read_dyna(exported.path.read_text(encoding="ascii"))
    numbers = [int(cards[0][0]) for _, cards in blocks]
    assert numbers == list(range(1, len(blocks) + 1))
    starts = [at for at, (name, _) in enumerate(blocks) if name == "MAT_SPRING_ELASTIC"]
    for at, (first, end) in enumerate(zip(starts, [*starts[1:], len(blocks)], strict=True)):
        rest = float(blocks[first][1][0][1])
        arms = np.array([cards[0][1:5] for _, cards in blocks[first + 1 : end]], dtype=float)
        k0, ki, beta, cut = arms.T
        assert not ki.any()
        assert (cut >= 1e20).all()
        found = relaxing(OMEGA, rest, k0, 1 / beta)
        assert np.abs(found / stiffness(two / "plain.json", at) - 1).max() < 1e-9


def test_a_table_has_every_arm_with_its_interval(two, tmp_path):
    path = export_results(two / "shear.json", "prony", tmp_path / "a.csv").path
    table = pl.read_csv(path).filter(pl.col("temperature [degC]") == 40.0)
    k, tau = table["K [N/m]"].to_numpy(), table["tau [s]"].to_numpy()
    assert np.abs(relaxing(OMEGA, k[0], k[1:], tau[1:]) / stiffness(two / "shear.json", 1) - 1).max() < 1e-9
    assert np.allclose(table["G [Pa]"].to_numpy(), BLOCK.modulus * k)
    assert np.allclose(table["g [1]"].drop_nulls().sum(), 1 - k[0] / k.sum())
    low, high = table["95 % from [N/m]"].to_numpy(), table["95 % to [N/m]"].to_numpy()
    assert ((low <= k) & (k <= high) & (low >= 0)).all()
    assert (high[k == 0] > 0).all()  # one-sided


def test_without_a_shape_there_are_normalised_moduli_only(two, tmp_path):
    exported = export_results(two / "plain.json", "abaqus", tmp_path / "a.inp")
    assert "no elastic moduli for 2 of 2 materials: state height, area, mode and poisson" in exported.notes[0]
    materials = read_abaqus(exported.path.read_text(encoding="ascii"))
    assert all(one["elastic"] is None for one in materials.values())
    whole = stiffness(two / "plain.json")
    g, _, tau = np.array(materials["MOUNT_1"]["terms"]).T
    instantaneous = float(next(line for line in exported.path.read_text().splitlines() if "K_0 = " in line).split()[4])
    assert np.abs(relaxing(OMEGA, 1 - g.sum(), g, tau) * instantaneous / whole - 1).max() < 1e-9
    with pytest.raises(ModelError, match=r"no elastic moduli.*--to lsdyna-springs needs no shape"):
        export_results(two / "plain.json", "lsdyna", tmp_path / "a.k")
    assert not (tmp_path / "a.k").exists()


def test_a_shape_may_be_stated_with_the_export(two, tmp_path):
    path = export_results(two / "plain.json", "abaqus", tmp_path / "a.inp", shape=BLOCK).path
    assert path.read_text().splitlines()[6:] == [
        *export_results(two / "shear.json", "abaqus", tmp_path / "b.inp").path.read_text().splitlines()[6:]
    ]
    relaxed = replace(BLOCK, bulk="relaxing")
    terms = read_abaqus(
        export_results(two / "plain.json", "abaqus", tmp_path / "c.inp", shape=relaxed).path.read_text()
    )
    g, k, _ = np.array(terms["MOUNT_1"]["terms"]).T
    assert np.array_equal(g, k)


@pytest.mark.sampled(4)
def test_too_many_terms_and_other_models_are_refused_with_a_remedy(tmp_path):
    made("prony:6", DISC).write(tmp_path / "many.json")
    with pytest.raises(ModelError, match=r"MOUNT_1: \d+ arms are more than the 17 .* fit --model prony:[12]"):
        export_results(tmp_path / "many.json", "lsdyna")
    made("fractional").write(tmp_path / "fractional.json")
    with pytest.raises(ModelError, match=r"fractional model is no Prony series.*--model prony"):
        export_results(tmp_path / "fractional.json", "abaqus")


def test_a_results_folder_stands_for_its_model(two, tmp_path):
    (tmp_path / "model.json").write_bytes((two / "shear.json").read_bytes())
    assert export_results(tmp_path, "ansys").path == tmp_path / "prony.mac"
    with pytest.raises(CampaignError, match="xlsx has no use for the shape"):
        export_results(tmp_path, "xlsx", shape=BLOCK)


@pytest.mark.sampled(6)
def test_names_are_distinct_and_of_letters(tmp_path):
    made("prony:1", BLOCK, tyres=("4 Büchse", "4 Buchse")).write(tmp_path / "model.json")
    names = list(read_abaqus(export_results(tmp_path, "abaqus").path.read_text(encoding="ascii")))
    assert names == ["M_4_BUCHSE_1", "M_4_BUCHSE_2", "M_4_BUCHSE_1_2", "M_4_BUCHSE_2_2"]


@pytest.mark.parametrize("name", ["zener", "maxwell:3"])
@pytest.mark.sampled(2)
def test_every_model_of_arms_is_a_prony_series(name, tmp_path):
    made(name).write(tmp_path / "model.json")
    blocks = read_dyna(export_results(tmp_path, "lsdyna-springs").path.read_text())
    rest, arms = float(blocks[0][1][0][1]), []
    for kind, cards in blocks[1:]:
        if kind == "MAT_SPRING_ELASTIC":
            break
        arms.append((float(cards[0][1]), 1 / float(cards[0][3])))
    springs, times = np.array(arms).T
    assert np.abs(relaxing(OMEGA, rest, springs, times) / stiffness(tmp_path / "model.json") - 1).max() < 1e-9
