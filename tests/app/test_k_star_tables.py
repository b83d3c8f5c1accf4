"""Tables of K* on the command line: identify without K1, and fit with what the table does not say."""

import csv
import io
import json

import numpy as np
import pytest

F = np.geomspace(0.1, 100.0, 8)
K = 2e5 * (1 + (0.05j * 2 * np.pi * F) ** 0.4)


@pytest.fixture
def dma(tmp_path):
    """A table of G' and tan δ [MPa] of a specimen whose K* is 50 mm times G*."""
    path = tmp_path / "dma.csv"
    modulus = K / 0.05 / 1e6
    rows = zip(F.tolist(), modulus.real.tolist(), (K.imag / K.real).tolist(), strict=True)
    path.write_text("\n".join(["f [Hz];G' [MPa];tan δ", *(";".join(map(repr, row)) for row in rows)]) + "\n", "utf-8")
    return path


SHAPES = [["--shape-factor", "50 mm"], ["--mode", "shear", "--height", "10 mm", "--area", "5 cm^2"]]


@pytest.mark.parametrize("shape", SHAPES)
def test_identify_without_k1_gives_k_star(run, dma, shape):
    ran = run("identify", dma, *shape)
    assert ran.exit_code == 0
    rows = list(csv.DictReader(io.StringIO(ran.stdout)))
    found = [float(row["Re K* [N/m]"]) + 1j * float(row["Im K* [N/m]"]) for row in rows]
    np.testing.assert_allclose(found, K, rtol=1e-9)
    assert {(row["K2 [N/m]"], row["C [N s/m]"], row["verdict"], row["remarks"]) for row in rows} == {("", "", "ok", "")}
    assert "8 rows: 8 with K*, 0 rejected" in ran.stderr
    assert "K2 and C need the static stiffness: state --k1" in ran.stderr


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.sampled(2)
def test_a_fit_takes_the_same_table(run, dma, tmp_path, shape):
    ran = run("fit", dma, *shape, "--model", "fractional", "--std", "1 %", "--out", tmp_path / "m.json", "--json")
    assert ran.exit_code == 0, ran.stderr
    assert "note: understood frequency: column 'f' [Hz]; K', or the storage modulus: column 'G'' [MPa]" in ran.stderr
    settings = json.loads((tmp_path / "m.json").read_text())["provenance"]["settings"]
    assert set(settings) >= {"shape_factor"} or settings["mode"] == "shear"


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "'G'' and 'tan δ' give a modulus, which becomes K* by the shape: state --shape-factor"),
        (["--shape-factor", "50"], "--shape-factor: '50' has no unit"),
        (["--shape-factor", "-5 mm"], "--shape-factor: '-5 mm' must be positive"),
        (["--height", "1 mm"], "--mode compression or --mode shear says what the height and the area are of"),
        (["--shape-factor", "5 mm", "--mode", "shear"], "both say how K* follows from a modulus: keep one"),
        (["--mode", "compression", "--height", "1 mm", "--area", "1 cm^2"], "G* is a modulus of shear"),
        (["--averages", "0.5", "--shape-factor", "1 m"], "--averages: there is at least one average"),
        (["--group", "x", "--shape-factor", "1 m"], "has no groups"),
        (["--column", "load=G'"], "--column: load is no role of a table of K*"),
    ],
)
@pytest.mark.parametrize("command", ["identify", "fit", "causality"])
def test_what_is_not_stated_is_asked_for(run, dma, command, more, said):
    ran = run(command, dma, *more)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
