"""The registry of model families: one line each, from which names, help, candidates and special cases are taken.

The properties of a family are the attributes of its class; see `interface.Model`. The class is imported when it is
first used, so that the command line can list the families without importing numpy.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from fourpole.errors import ModelError
from fourpole.face import load

if TYPE_CHECKING:
    from fourpole.models.interface import Model

#: Name and class of each family, in the order of help and of `auto`. `:N` is a size, optional if it is in brackets.
FAMILIES = {
    "spring": "springs.Spring",
    "kelvin": "springs.KelvinVoigt",
    "zener": "maxwell.Zener",
    "maxwell[:N]": "maxwell.GeneralisedMaxwell",
    "prony[:N]": "maxwell.Prony",
    "fractional": "fractional.FractionalZener",
    "fractional5": "fractional.FractionalZener5",
    "resonant[:N]": "resonant.Resonant",
    "kraus": "kraus.Kraus",
}
#: The same of rooms above: models by name, for one condition; neither `auto` nor maps try them.
NAMED = {
    "structural": "fourpole.paper1982.models.Structural",
    "gehman:N": "fourpole.paper1982.models.GehmanLaw",
    "shell": "fourpole.paper1982.shell.Shell",
}
#: A relaxing specimen about a mass: the belt is found in K* and taken off, then the springs are fitted by `auto`.
BELT = "belt"
#: Other names of models, by what a specimen has.
ALSO = {"inertia track": "resonant:1"}
#: Names of all families, as help and messages list them.
NAMES = ", ".join([*FAMILIES, BELT, *ALSO, *NAMED])
_PLACES = {
    key.partition(":")[0].rstrip("["): (key, place)
    for key, place in [*((key, f"fourpole.models.{place}") for key, place in FAMILIES.items()), *NAMED.items()]
}


def model_named(name: str) -> Model:
    """The model of a name: a family, or a family with its size.

    Raises
    ------
    ModelError
        If no model has that name, or the family has no such size.

    Examples
    --------
    >>> model_named("maxwell:3").name
    'maxwell:3'
    """
    family, mark, size = _split(name)
    key = _PLACES.get(family, ("", ""))[0]
    # The bare name of a family with an optional size is a model, of the size that the class has by default.
    usual = "[:N]" in key and not _class(family).sizes
    sized = ":N" in key and (bool(mark) or not usual)
    number = size.isdecimal() and len(size) < 4
    if not key or sized != bool(mark) or (sized and not number):
        from fourpole.units import shown

        raise ModelError(f"no model {shown(name)}: choose one of {NAMES}, with a number for N")
    made: Model = _class(family)(*([int(size)] if sized else []))
    return made


def automatic(decades: float = float("inf")) -> tuple[str, ...]:
    """Names of the families that `auto` tries for a band of so many decades; a family with `sizes` by its bare name."""
    classes = ((family, _class(family)) for family in _compared())
    return tuple(family for family, one in classes if one.candidate and one.least_decades <= decades)


def for_maps() -> tuple[str, ...]:
    """Names of the models that an automatic operating map tries."""
    return tuple(name for family in _compared() for name in _class(family).for_maps)


def check_several(name: str) -> None:
    """ModelError if a model is for one condition only, where several are to be fitted or mapped."""
    if _PLACES.get(_split(name)[0], ("",))[0] in NAMED:
        raise ModelError(
            f"the {name} model is for one condition: for several, as over pressure, fourpole map makes a map of "
            f"{', '.join(for_maps())}"
        )


def sizes_of(name: str) -> range:
    """Sizes that are tried for the bare name of a family; an empty range for every other name."""
    return _class(name).sizes if name in _PLACES else range(0)


def by_amplitude(name: str) -> bool:
    """Whether K* of a model also depends on the amplitude of the deflection; False for a name that is none."""
    return name in _PLACES and _class(name).by_amplitude


def has_inertia(name: str) -> bool:
    """Whether a model has the inertia of a specimen in K*; False for a name that is none."""
    family, *_ = _split(name)
    return family in _PLACES and _class(family).has_inertia


def contains(larger: str, smaller: str) -> bool:
    """Whether the second model is a special case of the first.

    Examples
    --------
    >>> contains("maxwell:3", "maxwell:2"), contains("fractional5", "spring"), contains("zener", "kelvin")
    (True, True, False)
    """
    (large, _, size), (small, _, own) = larger.partition(":"), smaller.partition(":")
    return int(size) > int(own) if large == small and own else small in _special_cases(large)


@cache
def _special_cases(family: str) -> frozenset[str]:
    """Families that are special cases of one family, directly or through other families; either side may state it."""
    pairs = {(one, case) for one in _compared() for case in _class(one).special_cases}
    pairs |= {(whole, one) for one in _compared() for whole in _class(one).special_case_of}
    found: set[str] = set()
    new = {family}
    while new:
        new = {case for whole, case in pairs if whole in new} - found
        found |= new
    return frozenset(found)


def _split(name: str) -> tuple[str, str, str]:
    """Family, colon and size of a name, or of the model that it is another name of."""
    return ALSO.get(name, name).partition(":")


def _class(family: str) -> type[Model]:
    """The class of a family, imported now."""
    found: type[Model] = load(_PLACES[family][1])
    return found


def _compared() -> list[str]:
    """The families without those of `NAMED`."""
    return [family for family, (key, _) in _PLACES.items() if key not in NAMED]
