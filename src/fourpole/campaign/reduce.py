"""The heavy half: each recording becomes phasors and verdict rows, independently, in parallel, and cached."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fourpole.campaign.cache import cache_name, recall, remember
from fourpole.campaign.folder import Campaign, Test, inside
from fourpole.campaign.load import MOST_BYTES, load_recording
from fourpole.core import checks
from fourpole.core.checks import Check, remarked
from fourpole.core.demodulation.demodulate import Demodulation, demodulate, first_guess
from fourpole.core.demodulation.steady import steady_part
from fourpole.core.demodulation.wander import follow_wander, refine_reference
from fourpole.core.phasor import CHANNELS, SYMBOLS
from fourpole.core.recording import Recording
from fourpole.errors import FourpoleError, RecordingError, TableError
from fourpole.io.source import sha256_of

__all__ = ["ROUTE_NEEDS", "Reduced", "reduce_tests", "response_hashes"]

_WORKERS = min(os.cpu_count() or 1, 8)
#: Channels that a route cannot do without.
ROUTE_NEEDS = {
    "joint": ("force_in", "motion_in"),
    "mobility": ("force_in", "motion_in"),
    "relative": CHANNELS,
    "transmissibility": ("motion_in", "motion_out"),
}


@dataclass(frozen=True)
class Reduced:
    """What one recording came to: amplitudes (none where it failed), verdict rows, and the hash of the file read."""

    found: Demodulation | None
    checks: tuple[Check, ...]
    sha256: str = ""


def reduce_tests(
    campaign: Campaign,
    tests: list[Test],
    route: str,
    *,
    cache: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Reduced]:
    """Reduce all tests, in their order; what `cache` holds already is not computed again."""
    results: dict[int, Reduced] = {}
    with ThreadPoolExecutor(max_workers=_WORKERS) as pool:
        try:
            for index, result in _unordered(pool, campaign, tests, route, cache):
                results[index] = result
                if progress is not None:
                    progress(len(results), len(tests))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [results[index] for index in range(len(tests))]


def _unordered(
    pool: ThreadPoolExecutor, campaign: Campaign, tests: list[Test], route: str, cache: Path | None
) -> Iterator[tuple[int, Reduced]]:
    """Results as they come; only a few tests are under way at once, so that memory stays bounded."""
    waiting = iter(enumerate(tests))
    running: dict[Future[Reduced], int] = {}
    most = 4 * _WORKERS
    while True:
        for index, test in waiting:
            running[pool.submit(_reduce, campaign, test, route, cache)] = index
            if len(running) >= most:
                break
        if not running:
            return
        done, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield running.pop(future), future.result()


def _reduce(campaign: Campaign, test: Test, route: str, cache: Path | None) -> Reduced:
    """One test, from the cache where it is there; whatever goes wrong stays with this test."""
    if test.problem:
        return Reduced(None, (remarked("tests.csv", "rejected", test.problem),))
    try:
        return _read_and_reduce(campaign, test, route, cache)
    except FourpoleError as error:
        remark = str(error)
    except MemoryError:
        remark = f"{test.file} does not fit into memory: cut it with window [s]"
    except Exception as error:  # noqa: BLE001 - a fault of ours in one test must not stop the others
        remark = f"a fault in Fourpole itself ({type(error).__name__}: {error}); please report it with this recording"
    return Reduced(None, (remarked("recording", "rejected", remark),))


def _read_and_reduce(campaign: Campaign, test: Test, route: str, cache: Path | None) -> Reduced:
    path = inside(campaign.folder, test.file)
    sha256 = sha256_of(path, max_bytes=MOST_BYTES, label=test.file)
    place = cache / cache_name(_depends_on(campaign, test, route), sha256) if cache is not None else None
    if place is not None and (known := recall(place)) is not None:
        return Reduced(*known, sha256)
    result = replace(_demodulated(campaign, path, test, route), sha256=sha256)
    if place is not None and result.found is not None:
        remember(place, result.found, result.checks)
    return result


def _demodulated(campaign: Campaign, path: Path, test: Test, route: str) -> Reduced:
    """Demodulate with all channels; one that is hurt and not needed by the route is left out with a warning."""
    needed = ROUTE_NEEDS[route]
    roles = [role for role in CHANNELS if campaign.stated.channels.named(role) is not None]
    lacking = [role for role in needed if role not in roles]
    if lacking:
        raise TableError(f"the {route} route needs {lacking[0]}, which [channels] in campaign.toml does not state")
    rows: list[Check] = []
    spare = [role for role in roles if role not in needed]
    try:
        recording, remarks = load_recording(campaign.folder, path, test, campaign.stated.channels, roles)
    except TableError as error:
        if not spare:
            raise
        recording, remarks = load_recording(campaign.folder, path, test, campaign.stated.channels, needed)
        rows.append(_left_out(spare[0], str(error)))
    rows += [remarked("time base", "warning", remark) for remark in remarks]
    if test.window is None:
        recording, cut = _trimmed(recording, test.value("frequency"))
        rows += cut
    recording, clipped = _unclipped(recording, needed)
    rows += clipped
    try:
        found, wandering = _followed(recording, test.value("frequency"))
    except RecordingError as error:
        present = [role for role in spare if role in recording.channels]
        if not present:
            raise
        found, wandering = _followed(recording.without(present[0]), test.value("frequency"))
        rows.append(_left_out(present[0], str(error)))
    return Reduced(found, (*rows, *wandering, *_judge(campaign, test, route, found)))


def _trimmed(recording: Recording, near: float | None) -> tuple[Recording, list[Check]]:
    """The steady part of a recording, and what was cut."""
    try:
        part = steady_part(recording, first_guess(recording, near))
    except RecordingError:
        return recording, []  # demodulation says what is wrong
    if part is None:
        return recording, []
    low, high = recording.span
    before, after = max(part[0] - low, 0.0), max(high - part[1], 0.0)
    cut = " and ".join(
        text
        for text in (
            f"the first {before:.3g} s (lead-in, run-up)" if before else "",
            f"the last {after:.3g} s (run-down)" if after else "",
        )
        if text
    )
    remark = f"{cut} of {high - low:.4g} s were cut, for the drive was not steady there; state window [s] to choose"
    return recording.between(*part), [remarked("steady part", "ok", remark)]


def _followed(recording: Recording, near: float | None) -> tuple[Demodulation, list[Check]]:
    """Amplitudes; along the phase of V1 where there is no reference and the speed wanders so that it matters."""
    found = demodulate(recording, near=near)
    if recording.reference is not None:
        return refine_reference(recording, found), []
    followed = follow_wander(recording, found)
    if followed is None:
        return found, []
    better, wander = followed
    remark = (
        f"the speed of the drive wanders by up to {wander.speed:.2%} of its mean, which makes V1/F1 or V2/V1 wrong by "
        f"{wander.shift:.2g} of it at one frequency: followed along the phase of V1; record a tacho or encoder and "
        "state it as [channels] reference"
    )
    return better, [Check("speed", wander.speed, 0.0, "warning", remark)]


def _left_out(role: str, why: str) -> Check:
    return remarked(SYMBOLS[role], "warning", f"{SYMBOLS[role]} was left out: {why}")


def _unclipped(recording: Recording, needed: tuple[str, ...]) -> tuple[Recording, list[Check]]:
    """Leave out a clipped channel that the route can spare; keep the verdict on one that it cannot."""
    rows = []
    for role, channel in list(recording.channels.items()):
        row = checks.check_clipping(SYMBOLS[role], channel)
        if row.verdict == "ok":
            continue
        if role in needed:
            rows.append(row)
        else:
            recording = recording.without(role)
            rows.append(_left_out(role, row.remark))
    return recording, rows


def _judge(campaign: Campaign, test: Test, route: str, found: Demodulation) -> Iterator[Check]:
    """The checks of one demodulated test; a fault of a channel that the route can spare only warns."""
    names = tuple(SYMBOLS[role] for role in CHANNELS)
    frequency = float(found.phasors.frequency)
    yield checks.check_frequency(frequency, test.value("frequency"))
    yield checks.check_gaps(found)
    yield checks.check_mains(found)
    yield checks.check_distortion(found)
    spared = tuple(SYMBOLS[role] for role in CHANNELS if role not in ROUTE_NEEDS[route])
    for row in (*checks.check_excitation(found, names), *checks.check_noise(found, names)):
        spare = row.verdict == "rejected" and row.name.endswith(spared) and bool(spared)
        yield replace(row, verdict="warning") if spare else row
    if np.isfinite(found.force_peak):
        yield checks.check_lift_off(found.force_peak, test.value("preload"))
    stated = campaign.stated.all_rigs.get(test.rig)
    if stated is not None and stated.output != "blocked":
        added = test.value("added_mass") or 0.0
        yield checks.check_resonance(frequency, stated.rig(), added)
        yield checks.check_consistency(found.phasors, stated.rig(), added)


def response_hashes(campaign: Campaign) -> dict[str, str]:
    """Hash of each table of a calibrated response that can be read, by its name in the campaign."""
    channels = (campaign.stated.channels.named(role) for role in CHANNELS)
    hashes = {}
    for name in {channel.response for channel in channels if channel is not None and channel.response is not None}:
        with suppress(FourpoleError):
            hashes[name] = sha256_of(inside(campaign.folder, name), max_bytes=MOST_BYTES, label=name)
    return hashes


def _depends_on(campaign: Campaign, test: Test, route: str) -> list[object]:
    """All that a reduced test depends on but its file: the channels, the rig and the row."""
    rig = campaign.stated.all_rigs.get(test.rig)
    return [
        ROUTE_NEEDS[route],
        test.kind,
        test.values,
        test.window,
        campaign.stated.channels.model_dump(),
        response_hashes(campaign),
        rig and repr(rig),
    ]
