"""The truth that a campaign's statements only approximate: its draws, and what is put in their place."""

import numpy as np
import pytest

from fourpole.virtual.recordings import draw_truth, state

DECLARED = {"tyre_mass": 0.8, "frame_stiffness": 4e6, "preload_loss_factor": 0.02, "input_mass": 0.5}
SENSORS = (0.01, 0.02)


def drawn(seed=1982, rig_error=None, undeclared=None, **said):
    return draw_truth(state(**said), np.random.default_rng(seed), rig_error=rig_error, undeclared=undeclared)


def values(truth):
    """Everything in one flat mapping."""
    return {**vars(truth.bench), **{f"{n} gain": e for n, e in truth.gain_errors.items()}} | {
        f"{n} phase": e for n, e in truth.phase_errors.items()
    }


def test_draws_are_those_of_the_statement_within_two_sigma():
    count = 500
    said = state(declared=DECLARED, sensors=SENSORS, rig_std={"moving_mass": 0.3})
    assert said.rig["moving_mass"] == (15.0, 0.3)
    truths = [drawn(seed, declared=DECLARED, sensors=SENSORS, rig_std={"moving_mass": 0.3}) for seed in range(count)]
    rig = [[getattr(t.bench, "mass" if n == "moving_mass" else n) for n in said.rig] for t in truths]
    stated = np.array(list(said.rig.values()))
    scatter = [(np.array(rig) - stated[:, 0]) / stated[:, 1]]
    for errors, stds in (("gain_errors", [0.01] * 3 + [2e-4] * 2), ("phase_errors", [0.02] * 3)):
        scatter.append([np.array(list(getattr(truth, errors).values())) / stds for truth in truths])
    z = np.hstack(scatter)
    assert z.shape == (count, 7 + 5 + 3)
    assert abs(z).max() <= 2.0 + 1e-9
    # a normal clipped at 2 sigma has a variance of 0.92; that of n draws is uncertain by sqrt(2/n) at most
    np.testing.assert_allclose(z.var(axis=0), 0.92, atol=5.0 * np.sqrt(2.0 / count))
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=5.0 / np.sqrt(count))


@pytest.mark.parametrize(
    ("change", "changed"),
    [
        ({"rig_error": {"moving_mass": 0.02}}, {"mass": 15.3}),
        ({"declared": DECLARED, "rig_error": {"tyre_mass": -0.1}}, {**DECLARED, "tyre_mass": 0.72}),
        (
            {"undeclared": {"frame_stiffness": 4e6, "leaf_friction": 2.0}},
            {"frame_stiffness": 4e6, "leaf_friction": 2.0},
        ),
        ({"undeclared": {"gain F1": 0.03, "phase V2": 0.01}}, {"F1 gain": 0.03, "V2 phase": 0.01}),
    ],
)
def test_what_is_put_in_the_place_of_a_draw_changes_nothing_else(change, changed):
    plain, other = values(drawn(sensors=SENSORS)), values(drawn(sensors=SENSORS, **change))
    assert {name for name in plain if plain[name] != other[name]} == set(changed)
    for name, value in changed.items():
        is_drawn = name in change.get("declared", {}) and name not in change.get("rig_error", {})
        assert other[name] == pytest.approx(value, rel=0.04 + 1e-9 if is_drawn else 1e-12)


def test_clean_campaign_is_as_stated_but_for_what_is_hidden():
    truth = drawn(clean=True, declared=DECLARED, undeclared={"gain V1": 0.01}, rig_error={"preload_damping": 1.0})
    assert {name: getattr(truth.bench, name) for name in DECLARED} == DECLARED
    assert (truth.bench.mass, truth.bench.preload_stiffness, truth.bench.preload_damping) == (15.0, 12440.0, 30.0)
    assert truth.gain_errors == {"F1": 0.0, "V1": 0.01, "V2": 0.0, "F": 0.0, "x": 0.0}
    assert set(truth.phase_errors.values()) == {0.0}


def test_the_gains_of_the_static_rig_may_be_given_too():
    drawn = draw_truth(state(), np.random.default_rng(1), undeclared={"gain F": 1e-3, "gain x": -2e-3})
    plain = draw_truth(state(), np.random.default_rng(1))
    assert (drawn.gain_errors["F"], drawn.gain_errors["x"]) == (1e-3, -2e-3)
    assert {name: drawn.gain_errors[name] for name in ("F1", "V1", "V2")} == {
        name: plain.gain_errors[name] for name in ("F1", "V1", "V2")
    }
    with pytest.raises(ValueError, match="phase F"):
        draw_truth(state(), np.random.default_rng(1), undeclared={"phase F": 1e-3})
