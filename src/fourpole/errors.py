"""The errors of Fourpole.

Each says what was found, where (file, column, row, test, frequency) and what to do, and is also
the builtin that a caller would catch without knowing Fourpole::

    FourpoleError
    ├── UnitError        (ValueError)   a quantity or unit that cannot be read, or of the wrong kind
    ├── FileError        (OSError)      a file that is missing, unreadable, too large or out of bounds
    ├── TableError       (ValueError)   a file that was read but does not hold what it must
    ├── CampaignError    (ValueError)   a campaign folder that cannot be analysed at all
    ├── RecordingError   (ValueError)   a recording from which no amplitude can be taken
    │   ├── ConstantError               a channel that does not move
    │   └── TooShortError               a recording of too few cycles
    ├── LoadCurveError   (ValueError)   a load-deflection curve that cannot answer
    ├── RigError         (ValueError)   a rig whose statement is impossible or incomplete
    └── ModelError       (ValueError)   a model that cannot be what is asked of it
"""

from __future__ import annotations

__all__ = [
    "CampaignError",
    "ConstantError",
    "FileError",
    "FourpoleError",
    "LoadCurveError",
    "ModelError",
    "RecordingError",
    "RigError",
    "TableError",
    "TooShortError",
    "UnitError",
]


class FourpoleError(Exception):
    """Base of all errors that Fourpole raises for its user's input."""


class UnitError(FourpoleError, ValueError):
    """A quantity or unit cannot be read, or is of the wrong kind."""


class FileError(FourpoleError, OSError):
    """A file is missing, unreadable, too large or outside its folder."""


class TableError(FourpoleError, ValueError):
    """A file was read but does not hold what it must."""


class CampaignError(FourpoleError, ValueError):
    """A campaign folder cannot be analysed at all."""


class RecordingError(FourpoleError, ValueError):
    """No amplitude can be taken from a recording."""


class ConstantError(RecordingError):
    """A channel does not move."""


class TooShortError(RecordingError):
    """A recording has too few cycles."""


class LoadCurveError(FourpoleError, ValueError):
    """A load-deflection curve cannot answer the question."""


class RigError(FourpoleError, ValueError):
    """A rig's statement is impossible or incomplete."""


class ModelError(FourpoleError, ValueError):
    """A model cannot be evaluated, fitted or stepped as asked."""
