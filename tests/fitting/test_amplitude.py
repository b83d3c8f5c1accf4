"""The amplitude of the deflection in tables, fits, maps, model files and queries."""

import json

import numpy as np
import polars as pl
import pytest

from fourpole.core.condition import AXES, Axis, Sameness
from fourpole.errors import ModelError
from fourpole.fitting.amplitude import COLUMN, amplitudes_of
from fourpole.fitting.byamplitude import told_apart
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.fitting.rows import STD
from fourpole.models import profile

LEVELS = (0.1e-3, 0.5e-3, 2e-3)
FREQUENCY = np.geomspace(2.0, 50.0, 6)


def k_star(f, x, preload=0.0):
    """Kraus's law with plateaus that grow with ln f; stiffer by 0.08 % per newton."""
    y = (x / 0.45e-3) ** 0.55
    small, large = 240e3 * (1 + 0.06 * np.log(f / 10)), 145e3 * (1 + 0.03 * np.log(f / 10))
    peak, rest = 30e3 * (f / 10) ** 0.06, 9e3 * (f / 10) ** 0.12
    k = large + (small - large) / (1 + y**2) + 1j * (rest + 2 * (peak - rest) * y / (1 + y**2))
    return k * (1 + 8e-4 * preload)


def table(levels=LEVELS, preloads=(None,), column=COLUMN, scale=1.0, noise=0.002):
    rng, rows = np.random.default_rng(5), []
    for preload in preloads:
        for f in FREQUENCY:
            for x in levels:
                k = k_star(f, x, preload or 0.0) * (1 + noise * complex(*rng.normal(size=2)))
                row = {"test": f"D{len(rows) + 1}", "tyre": "mount", "frequency [Hz]": f, column: x / scale}
                row |= {"Re K* [N/m]": k.real, "Im K* [N/m]": k.imag}
                row |= {"u(Re K*) [N/m]": noise * abs(k), "u(Im K*) [N/m]": noise * abs(k)}
                rows.append(row | ({} if preload is None else {"preload [N]": preload}))
    return pl.DataFrame(rows)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    measured = measured_of(table(), by_amplitude=True)
    path = tmp_path_factory.mktemp("kraus") / "model.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(profile, "_MOST_WORK", 0)  # intervals by profile likelihood would take seconds
        model_file(measured, fit_tyres(measured, "kraus")).write(path)
    return path


def test_a_left_out_amplitude_is_answered_within_two_per_cent_and_its_uncertainty(fitted):
    file, off, scores = read_model_file(fitted), [], []
    for x in (0.15e-3, 0.25e-3, 0.8e-3, 1.4e-3):
        for row in ask(file, Query([2.0, 7.0, 20.0, 50.0], {COLUMN: x})):
            exact = k_star(row["frequency [Hz]"], x)
            off.append(abs((row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]) / exact - 1))
            scores.append(abs(row["Re K* [N/m]"] - exact.real) / row["u(Re K*) [N/m]"])
            assert row[COLUMN] == x
            assert row["K1 [N/m]"] is None
            assert row["C [N s/m]"] is None
    assert max(off) < 0.02
    assert max(scores) < 4


def test_between_two_tested_amplitudes_the_law_itself_is_uncertain(fitted):
    """A 24th of the change between the two half way, nothing at them."""
    file = read_model_file(fitted)
    low, high = LEVELS[:2]
    at = {x: ask(file, Query([10.0], {COLUMN: x}))[0] for x in (low, np.sqrt(low * high), high)}
    below, middle, above = at.values()
    bend = abs(above["Re K* [N/m]"] - below["Re K* [N/m]"]) / 24
    assert middle["u(Re K*) [N/m]"] == pytest.approx(bend, rel=0.1)
    assert max(one["u(Re K*) [N/m]"] for one in (below, above)) < 0.5 * bend


def test_the_file_states_the_tested_amplitudes_and_says_nothing_of_a_linear_tyre(fitted):
    document = json.loads(fitted.read_text(encoding="utf-8"))
    (condition,) = document["models"][0]["conditions"]
    assert condition["amplitude"] == pytest.approx(LEVELS)
    assert condition["verdict"] is None
    assert "can be told apart: variance inflation of the amplitude exponents 1" in document["models"][0]["choice"]


@pytest.mark.parametrize(
    ("state", "said"),
    [({}, r"state --amplitude: .* tested from 0.1 mm to 2 mm"), ({COLUMN: 3e-3}, "3 mm is outside the tested ones")],
)
def test_an_amplitude_that_is_missing_or_outside_is_refused(fitted, state, said):
    with pytest.raises(ModelError, match=said):
        ask(read_model_file(fitted), Query([10.0], state))


def test_beyond_the_tested_amplitudes_it_is_answered_with_a_remark(fitted):
    (row,) = ask(read_model_file(fitted), Query([10.0], {COLUMN: 3e-3}, beyond=True))
    assert "3 mm is outside the tested ones" in row["remarks"]


@pytest.mark.parametrize("change", [None, [2e-3, 1e-4], [1e-3]])
def test_a_file_without_the_amplitudes_or_with_falling_ones_is_refused(fitted, tmp_path, change):
    document = json.loads(fitted.read_text(encoding="utf-8"))
    document["models"][0]["conditions"][0]["amplitude"] = change
    path = tmp_path / "changed.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ModelError):
        read_model_file(path)


@pytest.mark.parametrize(("column", "scale"), [("amplitude [mm]", 1e-3), ("deflection amplitude [um]", 1e-6)])
def test_the_column_may_have_another_name_and_unit(column, scale):
    measured = measured_of(table(column=column, scale=scale), by_amplitude=True)
    assert measured.conditions[0].own.amplitude == pytest.approx(np.tile(LEVELS, 6))


def test_older_results_give_it_from_the_velocities():
    w = 2 * np.pi * 10.0
    row = {"frequency [Hz]": 10.0, "F1 [N]": 200.0, "V1 [m/s]": 0.3, "phase V2-V1 [rad]": np.pi / 2}
    row |= {"Re K* [N/m]": 3e5, "Im K* [N/m]": 4e5}
    both = pl.DataFrame([row | {"V2 [m/s]": 0.4}, row | {"V2 [m/s]": None}])
    assert amplitudes_of(both) == pytest.approx([0.5 / w, 200 / 5e5])


def test_without_the_column_the_family_is_refused():
    with pytest.raises(ModelError, match="no column 'deflection amplitude"):
        measured_of(table().drop(COLUMN), by_amplitude=True)


def test_an_amplitude_that_goes_with_the_frequency_gives_no_numbers():
    one = table(levels=(1e-3,)).with_columns((pl.col("frequency [Hz]") * 1e-5 + 1e-4).alias(COLUMN))
    for made in (fit_tyres, map_tyres):
        with pytest.raises(ModelError, match=r"cannot be told apart.*variance inflation") as said:
            made(measured_of(one, by_amplitude=True), "kraus")
        assert "No number of the Payne effect" in str(said.value)


def test_conditions_that_tell_them_apart_are_fitted_and_the_others_are_named():
    both = pl.concat([table(preloads=(100.0,)), table(levels=(1e-3,), preloads=(200.0,))])
    kept, text = told_apart("mount", measured_of(both, by_amplitude=True).conditions, "kraus")
    assert [one.label for one in kept] == ["100 N"]
    assert "In 1 conditions they cannot be told apart, and these are not fitted: 200 N" in text


def test_an_axis_of_the_campaign_with_the_amplitude_does_not_part_the_conditions_of_the_family():
    axis = Axis("amplitude [mm]", relative=0.05)
    frame = table().with_columns((pl.col(COLUMN) * 1e3).alias("amplitude [mm]"))
    rule = Sameness((*AXES, axis))
    assert len(measured_of(frame, rule=rule).conditions) == 3
    (one,) = measured_of(frame, rule=rule, by_amplitude=True).conditions
    assert one.own.count == 18


def joined(frame, own_std, shared_std):
    """covariance.parquet of the joint route: K* of all amplitudes at one frequency is one K*."""
    rows = []
    for at, row in enumerate(frame.to_dicts()):
        own = (own_std * row["Re K* [N/m]"]) ** 2
        rows.append({"test": row["test"], "rig": "", "condition": at // len(LEVELS),
                     "own covariance Re, Im K* [N2/m2]": [own, 0.0, 0.0, own],
                     "shared Re K* [N/m]": [shared_std * row["Re K* [N/m]"]],
                     "shared Im K* [N/m]": [shared_std * row["Im K* [N/m]"]]})  # fmt: skip
    return pl.DataFrame(rows)


def test_tests_that_share_a_k_star_in_the_joint_route_are_apart_with_their_own_uncertainty():
    """The scatter over the amplitudes, 10 % here, is no uncertainty of the K* of a test; a common gain stays common."""
    frame = table().drop(STD[:2])
    size = np.hypot(frame["Re K* [N/m]"].to_numpy(), frame["Im K* [N/m]"].to_numpy())
    whole = {name: np.hypot(0.002 * size, 0.01 * frame[f"{part} K* [N/m]"].to_numpy())
             for name, part in zip(STD, ("Re", "Im"), strict=False)}  # fmt: skip
    both = 1e-4 * frame["Re K* [N/m]"].to_numpy() * frame["Im K* [N/m]"].to_numpy()
    whole[STD[2]] = both / (whole[STD[0]] * whole[STD[1]])
    frame = frame.with_columns(**{name: pl.Series(one) for name, one in whole.items()})
    covariance = joined(frame, 0.1, 0.01)
    (mixed,) = measured_of(frame, covariance).conditions
    assert mixed.own.count == 6
    (apart,) = measured_of(frame, covariance, by_amplitude=True).conditions
    assert apart.own.count == 18
    own = np.sqrt(apart.own.covariance[:, 0, 0]) / np.abs(apart.own.stiffness)
    assert own == pytest.approx(np.full(18, 0.002), rel=1e-6)
    assert apart.shared[::2, 0] == pytest.approx(0.01 * apart.own.stiffness.real)


def test_without_scatter_the_information_of_one_k_star_is_not_counted_three_times():
    frame = table()
    (apart,) = measured_of(frame, joined(frame, 0.002, 0.0), by_amplitude=True).conditions
    own = np.sqrt(apart.own.covariance[:, 0, 0]) / np.abs(apart.own.stiffness)
    assert own == pytest.approx(np.full(18, 0.002 * np.sqrt(3)), rel=1e-6)


@pytest.mark.sampled(2)
def test_another_model_takes_all_amplitudes_as_one_k_star_and_says_so():
    measured = measured_of(table())
    (note,) = (one for one in measured.notes if "amplitudes of 0.1 to 2 mm" in one)
    assert "fit kraus, or state --over amplitude" in note
    assert not any("amplitudes" in one for one in measured_of(table(levels=(1e-3,))).notes)
    (found,) = fit_tyres(measured, "kelvin")
    assert found.discrepancy > 0.05


@pytest.mark.sampled(2)
def test_a_map_over_the_amplitude_is_scaled_by_its_logarithm(tmp_path):
    levels = np.geomspace(0.1e-3, 2e-3, 6)
    measured = measured_of(table(levels), over=["amplitude"])
    path = tmp_path / "map.json"
    model_file(measured, maps=map_tyres(measured, "kelvin", ["amplitude"])).write(path)
    (axis,) = json.loads(path.read_text(encoding="utf-8"))["maps"][0]["axes"]
    assert (axis["name"], axis["logarithmic"]) == ("deflection amplitude", True)
    exact = k_star(10.0, 0.2e-3).real
    (row,) = ask(read_model_file(path), Query([10.0], {COLUMN: 0.2e-3}))
    assert row["Re K* [N/m]"] == pytest.approx(exact, abs=3 * row["u(Re K*) [N/m]"])
    with pytest.raises(ModelError, match="state --amplitude"):
        ask(read_model_file(path), Query([10.0]))


@pytest.mark.sampled(2)
def test_the_option_finds_an_amplitude_that_the_campaign_states_in_a_column_of_its_own(tmp_path):
    column = "amplitude [mm]"
    frame = table(np.geomspace(0.1e-3, 2e-3, 6)).with_columns((pl.col(COLUMN) * 1e3).alias(column))
    measured = measured_of(frame, rule=Sameness((*AXES, Axis(column, relative=0.05))))
    path = tmp_path / "map.json"
    model_file(measured, maps=map_tyres(measured, "kelvin")).write(path)
    file = read_model_file(path)
    (one,), (other,) = (ask(file, Query([10.0], state)) for state in ({COLUMN: 0.2e-3}, {column: 0.2}))
    assert one == pytest.approx(other)


@pytest.mark.sampled(2)
def test_a_map_of_the_family_over_tension_zero_and_compression(tmp_path):
    measured = measured_of(table(preloads=(-100.0, 0.0, 150.0)), by_amplitude=True)
    path = tmp_path / "map.json"
    model_file(measured, maps=map_tyres(measured, "kraus")).write(path)
    file = read_model_file(path)
    for preload in (-60.0, 0.0, 80.0):
        (row,) = ask(file, Query([10.0], {"preload [N]": preload, COLUMN: 0.25e-3}))
        exact = k_star(10.0, 0.25e-3, preload)
        assert abs((row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"]) / exact - 1) < 0.02
