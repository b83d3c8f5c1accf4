"""The errors of Fourpole.

The message of an error names what was found, where (file, column, row, test, frequency), and what to do. Each class is
also a builtin error, which a caller can catch without knowing Fourpole::

    FourpoleError
    ├── UnitError        (ValueError)   a quantity or unit that cannot be read, or of the wrong kind
    ├── FileError        (OSError)      a file that is missing, unreadable, too large or out of bounds
    ├── TableError       (ValueError)   a file that was read but lacks a column or value
    ├── CampaignError    (ValueError)   a campaign folder that cannot be analysed at all
    ├── RecordingError   (ValueError)   a recording from which no amplitude can be taken
    │   ├── ConstantError               a channel that does not move
    │   └── TooShortError               a recording of too few cycles
    ├── LoadCurveError   (ValueError)   a load-deflection curve without the value needed
    ├── RigError         (ValueError)   a rig whose statement is impossible or incomplete
    └── ModelError       (ValueError)   a model that cannot be evaluated, fitted or stepped
"""

from __future__ import annotations

import errno
from dataclasses import dataclass

#: Words of an error of polars, or of Python's threads, that has no type of its own where memory runs out.
_NO_MEMORY = ("os error 12", "out of memory", "can't start new thread", "could not spawn threads")


def out_of_memory(error: BaseException) -> bool:
    """Whether an error of Python or of a library says that memory ran out.

    Examples
    --------
    >>> out_of_memory(MemoryError()), out_of_memory(OSError("Cannot allocate memory (os error 12)"))
    (True, True)
    """
    if isinstance(error, FourpoleError | ValueError):
        return False
    known = isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM
    return known or any(words in str(error) for words in _NO_MEMORY)


@dataclass(frozen=True)
class Message:
    """What an error says, as a value that can be kept: the code of its kind, where it was raised, and its sentence."""

    code: str
    site: str
    text: str

    def __str__(self) -> str:
        return self.text


class FourpoleError(Exception):
    """Base of all errors that Fourpole raises for its user's input."""

    #: Name of the kind of error in results.
    code = "input"
    #: Where it was raised in another process; empty in the process that raised it.
    raised_at = ""

    @property
    def site(self) -> str:
        """The function that raised it, by which errors of one kind are known whatever numbers they name.

        Examples
        --------
        >>> try:
        ...     raise TooShortError("D1.csv holds 1.2 cycles")
        ... except FourpoleError as error:
        ...     error.code, error.site
        ('length', '<module>')
        """
        trace = self.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        return self.raised_at or (trace.tb_frame.f_code.co_qualname if trace is not None else "")

    @property
    def message(self) -> Message:
        """What it says, as a value."""
        return Message(self.code, self.site, str(self))


class ResultsWarning(UserWarning):
    """A file of the results is not as they list it, and another copy is used; or it cannot be replaced now."""


class UnitError(FourpoleError, ValueError):
    """A quantity or unit cannot be read, or is of the wrong kind."""

    code = "unit"


class FileError(FourpoleError, OSError):
    """A file is missing, unreadable, too large or outside its folder."""

    code = "file"


class TableError(FourpoleError, ValueError):
    """A file was read, but a column or value that it must hold is missing or impossible."""

    code = "table"


class CampaignError(FourpoleError, ValueError):
    """No test of a campaign folder can be analysed."""

    code = "campaign"
    #: All faults of a statement, of which the message has the first; empty for another error.
    faults: tuple[str, ...] = ()


class RecordingError(FourpoleError, ValueError):
    """No amplitude can be taken from a recording."""

    code = "recording"


class ConstantError(RecordingError):
    """A channel does not move."""

    code = "constant channel"


class TooShortError(RecordingError):
    """A recording has too few cycles."""

    code = "length"


class LoadCurveError(FourpoleError, ValueError):
    """A load-deflection curve does not give the value needed, as beyond its largest load."""

    code = "load curve"


class RigError(FourpoleError, ValueError):
    """A rig's statement is impossible or incomplete."""

    code = "statement of the rig"


class ModelError(FourpoleError, ValueError):
    """A model cannot be evaluated, fitted or stepped with the arguments given."""

    code = "model"
