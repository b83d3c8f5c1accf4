"""Commands that a page may start: what they are about, and their options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fourpole.errors import CampaignError
from fourpole.units import shown

#: Longest value of an option.
_LONGEST = 200


@dataclass(frozen=True)
class AskedOption:
    """An option of a command.

    Attributes
    ----------
    name : str
        As the command line has it, as "--wanted".
    help : str
    flag : bool
        Whether it takes no value.
    """

    name: str
    help: str
    flag: bool


@dataclass(frozen=True)
class Asked:
    """A command.

    Attributes
    ----------
    name : str
    about : str
        What it does, in a sentence.
    options : tuple of AskedOption
    """

    name: str
    about: str
    options: tuple[AskedOption, ...]

    def words(self, stated: Mapping[str, str]) -> list[str]:
        """The options of the command line for what a form states; each value is part of one word."""
        words = []
        for one in self.options:
            value = stated.get(one.name.strip("-"), "").strip()
            if len(value) > _LONGEST or not value.isprintable():
                raise CampaignError(f"{one.name}: {shown(value)} is no value")
            if value:
                words.append(one.name if one.flag else f"{one.name}={value}")
        return words


def asked_named(commands: Sequence[Asked], name: str) -> Asked:
    """The command of a name; CampaignError if a page may not start it."""
    found = next((one for one in commands if one.name == name), None)
    if found is None:
        raise CampaignError(f"no command {shown(name)} can be started here")
    return found
