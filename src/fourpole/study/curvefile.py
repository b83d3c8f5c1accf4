"""The curve of a static test: from the cache, or from its file, in a worker process if there is a reason."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fourpole.campaign.channels import CLASSES as CHANNEL_CLASSES
from fourpole.campaign.channels import ChannelsFile
from fourpole.campaign.folder import Campaign
from fourpole.campaign.place import at_hand, identity_or_none
from fourpole.campaign.row import Test
from fourpole.core.loadcurve import LoadCurve
from fourpole.errors import FileError, FourpoleError, Message
from fourpole.io.child import SECONDS, Died, Late, answer_of
from fourpole.io.door import sha256_of
from fourpole.io.identity import Identity
from fourpole.io.packed import pack, unpack
from fourpole.study.cache import Cache
from fourpole.study.guard import is_guarded
from fourpole.study.load import MOST_BYTES, load_curve

#: A curve of more bytes is not kept.
_MOST_KEPT = 16_000_000
#: The parts of [channels] that a curve depends on.
_OF_CURVE = ("time", "sample_rate", "load", "deflection")


@dataclass(frozen=True)
class CurveJob:
    """The file of a static test, with all that its curve depends on."""

    folder: Path
    test: Test
    channels: ChannelsFile

    @property
    def settings(self) -> list[object]:
        """What the curve depends on beside the content of the file."""
        return ["static", self.test.file, self.test.window, self.channels.without_uncertainties(*_OF_CURVE)]


@dataclass(frozen=True)
class CurveOfFile:
    """A curve, with the share of its samples that were missing [1] and the hash of its file; or else the reason."""

    curve: LoadCurve | None
    sha256: str
    missing: float = 0.0
    error: Message | None = None


#: The classes of which a job is made, and of which its result.
OF_WORK = (CurveJob, Test, *CHANNEL_CLASSES)
_CLASSES = (CurveOfFile, LoadCurve, Message)


def curve_of(job: CurveJob) -> bytes:
    """The packed curve of a file; FileError if it cannot be read."""
    with at_hand(job.folder, job.test.file) as path:
        sha256 = sha256_of(path, max_bytes=MOST_BYTES, label=job.test.file)
        try:
            curve = load_curve(path, job.test, job.channels)
        except FileError:  # says nothing of the content
            raise
        except FourpoleError as error:
            return pack(CurveOfFile(None, sha256, error=error.message))
        return pack(CurveOfFile(curve, sha256, curve.missing))


def read_curve(campaign: Campaign, test: Test, cache: Cache | None = None, seconds: float = SECONDS) -> CurveOfFile:
    """The curve of a static test.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    test : Test
        A static test of it.
    cache : Cache, optional
        The cache, in which it may stand, and in which it is kept.
    seconds : float [s]
        Limit of the processor time of a file that is read in a worker process.

    Raises
    ------
    FourpoleError
        If there is no such file, or its worker process dies twice.
    """
    job = CurveJob(campaign.folder.absolute(), test, campaign.stated.channels)
    identity = identity_or_none(job.folder, test.file)
    if cache is not None and (noted := cache.hash_noted(test.file, identity)):
        kept = cache.bytes_of(cache.name(job.settings, noted))
        with suppress(ValueError, KeyError, TypeError, IndexError):
            if kept is not None:
                return _unpacked(kept)
    content = _read(job, identity, seconds)
    found = _unpacked(content)
    if cache is not None:
        cache.note(test.file, identity, found.sha256)
        if found.curve is not None and len(content) < _MOST_KEPT:
            cache.keep(cache.name(job.settings, found.sha256), content)
    return found


def _unpacked(content: bytes) -> CurveOfFile:
    found = unpack(content, _CLASSES)
    if not isinstance(found, CurveOfFile):
        raise ValueError("the bytes hold no curve")
    if found.curve is not None:
        object.__setattr__(found.curve, "missing", found.missing)  # the points that it counts are not kept
    return found


def _read(job: CurveJob, identity: Identity | None, seconds: float) -> bytes:
    """The packed curve, from a worker process if the file is one that is read there."""
    if not is_guarded(job.folder, job.test.file):
        return curve_of(job)
    size = identity.size if identity is not None else 0
    try:
        return answer_of(curve_of, job, size=size, seconds=seconds)
    except Died as death:
        remedy = f"allow more with --time-limit, or {death.remedy}" if isinstance(death, Late) else death.remedy
        raise FileError(f"{job.test.file} {death}; {remedy}") from None
