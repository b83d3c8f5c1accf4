"""Channels by their names: the indices of those that a user names, and the messages if a name is missing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from fourpole.errors import TableError
from fourpole.units import column_unit, nearest, shown
from fourpole.words import first_of

Place = tuple[str, str]
"""Group and name of a channel."""

#: Largest number of names in a message.
_SHOWN = 12
#: Characters of a name, and number of names, that are compared with a misspelt one.
_COMPARED, _MOST_COMPARED = 60, 500


def in_group(places: Sequence[Place], group: str, label: str) -> list[int]:
    """Indices of the channels of a group, of all channels if `group` is empty; TableError if there is no such group.

    A group is found by its name as written, or else by its name in another case.
    """
    if not group:
        return list(range(len(places)))
    groups = list(dict.fromkeys(one for one, _ in places if one))
    if not groups:
        raise TableError(f"{label}: has no groups; leave out '#{shown(group)[1:-1]}' after the file")
    for same in ([group] * (group in groups), [one for one in groups if one.casefold() == group.casefold()]):
        if len(same) == 1:
            return [index for index, (one, _) in enumerate(places) if one == same[0]]
    raise TableError(f"{label}: there is no group {shown(group)}{listed(groups, group)}")


def named(places: Sequence[Place], chosen: Sequence[int], wanted: str) -> list[int]:
    """The chosen indices whose channel has the wanted name; empty if there is none.

    A name is compared as written, then without the unit in its brackets, both then in any case. A channel in a group is
    also called `group/name`. The first comparison that finds a channel decides.
    """
    bare = column_unit(wanted)[0].casefold()
    ways: tuple[Callable[[Place], bool], ...] = (
        lambda place: place[1] == wanted,
        lambda place: "/".join(place) == wanted,
        lambda place: column_unit(place[1])[0] == wanted,
        lambda place: place[1].casefold() == wanted.casefold(),
        lambda place: "/".join(place).casefold() == wanted.casefold(),
        lambda place: column_unit(place[1])[0].casefold() in (wanted.casefold(), bare),
    )
    found = ([index for index in chosen if is_same(places[index])] for is_same in ways)
    return next(filter(None, found), [])


def matching(places: Sequence[Place], chosen: Sequence[int], wanted: str, label: str) -> list[int]:
    """The chosen indices whose channel has the wanted name, as `named` finds them; TableError if there is none."""
    if found := named(places, chosen, wanted):
        return found
    raise TableError(
        f"{label}: there is no channel {shown(wanted)}{listed([places[index][1] for index in chosen], wanted)}"
    )


def only(places: Sequence[Place], chosen: Sequence[int], wanted: str, label: str) -> int:
    """Index of the one channel that has the wanted name; TableError if there is none, or more than one."""
    found = matching(places, chosen, wanted, label)
    if len(found) == 1:
        return found[0]
    groups = list(dict.fromkeys(places[index][0] for index in found))
    if len(groups) == len(found):
        which = ", ".join(shown(group) for group in groups[:_SHOWN])
        example = shown(next((group for group in groups if group), groups[0]), 60)[1:-1]
        raise TableError(
            f"{label}: channel {shown(wanted)} is in the groups {which}; say which, as in {label}#{example}"
        )
    which = ", ".join(shown(places[index][1]) for index in found[:_SHOWN])
    what = f"channel {shown(wanted)} is ambiguous: {len(found)} have that name ({which})"
    raise TableError(f"{label}: {what}; rename them in the file")


def listed(names: Sequence[str], wanted: str) -> str:
    """The end of a message that a name is missing: the nearest name, if one is near, and the first names."""
    known = list(dict.fromkeys(one for one in names if one))
    if not known:
        return "; it has none"
    folded = {one[:_COMPARED].casefold(): one for one in reversed(known[:_MOST_COMPARED])}
    near = [folded[one] for one in filter(None, [nearest(wanted[:_COMPARED].casefold(), folded)])]
    hint = f"; did you mean {shown(near[0])}?" if near else ";"
    ordered = list(dict.fromkeys([*near, *known]))
    return f"{hint} it has {first_of([shown(one)[1:-1] for one in ordered], _SHOWN)}"


def numbered(names: Sequence[str]) -> list[str]:
    """The names, with .1, .2, ... appended to a name that several channels have.

    Examples
    --------
    >>> numbered(["F1", "V1", "F1"])
    ['F1.1', 'V1', 'F1.2']
    """
    uses, count = Counter(names), Counter[str]()
    found = []
    for name in names:
        count[name] += 1
        found.append(f"{name}.{count[name]}" if uses[name] > 1 else name)
    return found
