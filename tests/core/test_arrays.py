"""What holds arrays compares by value, and never raises."""

import dataclasses
import inspect
import pkgutil
from importlib import import_module

import numpy as np
import polars as pl
import pytest

import fourpole
from fourpole import Channel, ChannelUncertainty, Phasors, Recording, Rig, identify
from fourpole.core.arrays import ByValue, same_value

HOLDS_ARRAYS = ("Array", "ndarray", "DataFrame")


def holds_arrays(field):
    return "Callable" not in str(field.type) and any(word in str(field.type) for word in HOLDS_ARRAYS)


def dataclasses_with_arrays(*, private):
    for module in pkgutil.walk_packages(fourpole.__path__, "fourpole."):
        for name, kind in vars(import_module(module.name)).items():
            if not inspect.isclass(kind) or kind.__module__ != module.name or name.startswith("_") != private:
                continue
            if dataclasses.is_dataclass(kind) and any(map(holds_arrays, dataclasses.fields(kind))):
                yield kind


def filled(kind, value):
    """An instance whose fields all hold the value, whatever its class would check."""
    made = object.__new__(kind)
    for field in dataclasses.fields(kind):
        object.__setattr__(made, field.name, value.copy())
    return made


@pytest.mark.parametrize("kind", list(dataclasses_with_arrays(private=True)), ids=lambda kind: kind.__qualname__)
def test_the_comparison_of_private_classes_with_arrays_does_not_raise(kind):
    value = np.array([1.0, 2.0])
    assert isinstance(filled(kind, value) == filled(kind, value), bool), "state eq=False"


@pytest.mark.parametrize("kind", list(dataclasses_with_arrays(private=False)), ids=lambda kind: kind.__name__)
def test_a_public_class_with_arrays_compares_by_value(kind):
    assert issubclass(kind, ByValue), "state eq=False and take ByValue as base"
    value = np.array([1.0, np.nan])
    assert filled(kind, value) == filled(kind, value)
    assert filled(kind, value) != filled(kind, value + 1)
    assert filled(kind, value) != filled(kind, np.ones((2, 3)))
    assert filled(kind, value) != "another"
    with pytest.raises(TypeError, match="unhashable"):
        hash(filled(kind, value))


@pytest.mark.parametrize(
    ("one", "same", "other"),
    [
        (np.array([1.0, np.nan]), np.array([1.0, np.nan]), np.array([1.0, 2.0])),
        (np.array([1j, complex(np.nan, 1)]), np.array([1j, complex(np.nan, 1)]), np.array([1j])),
        (np.array(["a", None], dtype=object), np.array(["a", None], dtype=object), np.array(["a", "b"], dtype=object)),
        (float("nan"), float("nan"), 1.0),
        ((np.zeros(2), "a"), (np.zeros(2), "a"), (np.zeros(2), "b")),
        ([np.zeros(2)], [np.zeros(2)], [np.zeros(2), np.zeros(2)]),
        ({"a": np.zeros(2)}, {"a": np.zeros(2)}, {"b": np.zeros(2)}),
        (pl.DataFrame({"a": [1.0, None]}), pl.DataFrame({"a": [1.0, None]}), pl.DataFrame({"a": ["x", None]})),
        (None, None, np.zeros(2)),
        (np.zeros(2), np.zeros(2), None),
        (1.5, 1.5, "text"),
        (1.5, 1.5, None),
    ],
)
def test_values_are_the_same_or_not(one, same, other):
    assert same_value(one, same)
    assert not same_value(one, other)
    assert not same_value(other, one)


def test_what_users_hold_compares():
    t = np.arange(100) / 100.0
    assert Recording.from_arrays(t, force_in=t, motion_in=t) == Recording.from_arrays(t, force_in=t, motion_in=t)
    assert Recording.from_arrays(t, force_in=t, motion_in=t) != Recording.from_arrays(t, force_in=t, motion_in=-t)
    assert Channel(t, "force") != Channel(t, "velocity")
    assert ChannelUncertainty() == ChannelUncertainty()
    phasors = Phasors.from_polar(10.0, 1.0, 1e-3, 1.51)
    rig = Rig(moving_mass=15.0, preload_stiffness=12440.0)
    assert identify(phasors, rig) == identify(phasors, rig)  # K2 and C are not-a-number here
    assert identify(phasors, rig) != identify(phasors, rig, k1=180e3)


def test_a_repr_shows_small_values_and_the_shape_of_large_ones():
    one = Phasors.from_polar(np.linspace(10.0, 20.0, 500), 1.0, 2e-3, 1.5)
    assert "frequency=<float64 500>" in repr(one)
    assert "amplitudes=<complex128 500×3>" in repr(one)
    assert len(repr(one)) < 1000
    assert "frequency=[10. 12.]" in repr(Phasors.from_polar([10.0, 12.0], 1.0, 2e-3, 1.5))


def test_what_a_long_text_or_many_fields_hold_is_cut():
    time = np.arange(3000) / 1000.0
    recording = Recording.from_arrays(time, force_in=time, motion_in=time, label="x" * 5000)
    assert "channels={force_in, motion_in}" in repr(recording)
    assert len(repr(recording)) < 300
