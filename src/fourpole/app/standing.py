"""How analyse begins: several campaigns, each by itself, and results that stand, which are not made again."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import typer

import fourpole
from fourpole.answer import Answer, Part, Table
from fourpole.app.console import OK, SOME_REJECTED, STOPPED, TERMINATED, UNREADABLE, one_of_several, run_to_exit, say
from fourpole.app.group import show
from fourpole.app.options import Wanted
from fourpole.core.checks import VERDICTS
from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.door import check_name, read_bytes, sha256_of
from fourpole.io.folders import is_for_keeping, resolved
from fourpole.io.identity import Identity, identity_of
from fourpole.io.userfolders import SIGNATURE_LENGTH, is_signed, signature

#: The folder of the cache, and the note in it: a JSON object with the signature of its other part.
_CACHE, _NOTE = "cache", Path("cache", "standing.json")
_HEAD, _MIDDLE, _END = b'{"signature": "', b'", "note": ', b"}"
_START = len(_HEAD) + 2 * SIGNATURE_LENGTH + len(_MIDDLE)
#: Largest note, which has 200 bytes of a recording, and largest input [byte].
_LARGEST, _MOST_BYTES = 100_000_000, 64_000_000_000
#: Programs on which the results depend; one that is not installed counts, too.
_PROGRAMS = ("numpy", "scipy", "polars", "pint", "matplotlib", "asammdf", "h5py", "npTDMS", "pyuff", "s3fs")
#: The files that state a campaign.
STATEMENT = ("campaign.toml", "tests.csv", "tests.xlsx", "limits.toml")


@dataclass(frozen=True)
class Outcome:
    """What a command said: notes on standard error, lines on standard output, its document, and its exit code."""

    notes: list[str] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    document: dict[str, Any] = field(default_factory=dict)
    code: int = 0


def results_of(campaign: Path, folder: Path | None) -> Path:
    """The folder of the results."""
    return folder if folder is not None else campaign / "results"


def settings_of(route: str, monte_carlo: int, wanted: Wanted) -> dict[str, Any]:
    """The settings on which the results depend."""
    return {"route": route, "monte_carlo": monte_carlo, **vars(wanted)}


def answer_of(outcome: Outcome, *, stands: bool = False, said: int = 0) -> Answer:
    """What an analysis said, as an answer; its first notes are `said` before."""

    def parts() -> Iterator[Part]:
        say(*outcome.notes[said:])
        if stands:
            say("nothing has changed since the last analysis: its results stand")
        yield from outcome.lines

    return Answer(parts(), lambda: outcome.document, code=outcome.code)


def standing(campaign: Path, results: Path, settings: dict[str, Any], *, verify: bool = False) -> Outcome | None:
    """What the analysis said whose results stand; None where it must be done.

    Parameters
    ----------
    campaign, results : Path
        The folders.
    settings : dict
        Settings on which the results depend.
    verify : bool
        Whether the content of every input is hashed; otherwise that of those whose size, time or inode differ.
    """
    try:
        note = _signed_note(campaign, results)
        if note is None:
            return None
        same = note["settings"] == settings and note["programs"] == _programs()
        if not same or not all(_is_as(results / name, noted) for name, noted in note["outputs"].items()):
            return None
        inputs = note["inputs"].items()
        if not all(_holds(campaign, name, noted, sha256, verify) for name, (noted, sha256) in inputs):
            return None
        return Outcome(**note["outcome"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def identities(campaign: Path, files: list[str]) -> dict[str, Identity | None]:
    """Identities of some files of a campaign, before they are read; None for one that is not there."""
    return {name: _identity(campaign, name) for name in files}


def note_standing(
    campaign: Path,
    results: Path,
    settings: dict[str, Any],
    inputs: dict[str, Identity | None],
    sha256: dict[str, str],
    outcome: Outcome,
) -> None:
    """Note all on which the results depend, so that they stand the next time."""
    from fourpole.errors import FileError
    from fourpole.io.write import write_bytes

    outputs = {}
    for path in sorted(results.rglob("*")):
        name = path.relative_to(results)
        if name.parts[0] != "cache" and not any(part.startswith(".") for part in name.parts) and path.is_file():
            outputs[name.as_posix()] = _state(path)
    note = {
        "settings": settings,
        "programs": _programs(),
        "inputs": {name: [one and list(one.parts), sha256.get(name, "")] for name, one in inputs.items()},
        "outputs": outputs,
        "outcome": vars(outcome),
    }
    body = json.dumps(note).encode()
    content = _HEAD + signature(body, *_purpose(campaign, results)).hex().encode() + _MIDDLE + body + _END
    with suppress(FileError):
        if is_for_keeping(results / _CACHE, campaign):
            write_bytes(results / _NOTE, content)


def forget(campaign: Path, results: Path) -> None:
    """Remove the note, before anything is written."""
    with suppress(OSError):
        if is_for_keeping(results / _CACHE, campaign):
            (results / _NOTE).unlink()


def _signed_note(campaign: Path, results: Path) -> Any:
    """The content of the note; None if there is none that this user's Fourpole wrote for these folders."""
    if not is_for_keeping(results / _CACHE, campaign):
        return None
    content = read_bytes(results / _NOTE, max_bytes=_LARGEST, within=results)
    body, signed = content[_START : -len(_END)], content[len(_HEAD) : len(_HEAD) + 2 * SIGNATURE_LENGTH]
    if content != _HEAD + signed + _MIDDLE + body + _END:
        return None
    return json.loads(body) if is_signed(body, bytes.fromhex(signed.decode()), *_purpose(campaign, results)) else None


def _purpose(campaign: Path, results: Path) -> tuple[str, ...]:
    """What a note is for: the analysis of one campaign into one folder."""
    return "standing", os.path.realpath(campaign), os.path.realpath(results)


def _place(campaign: Path, name: str) -> Path:
    """Path of a file of a campaign, without the group in `file#group`."""
    if "://" in name:
        from fourpole.campaign.place import inside  # few campaigns have URLs, and this loads much

        return inside(campaign, name)
    path = campaign / name
    return campaign / name.rpartition("#")[0] if "#" in name and not path.exists() else path


def _identity(campaign: Path, name: str) -> Identity | None:
    """Identity of a file of a campaign; None if it cannot be looked up."""
    with suppress(OSError, ValueError):
        if "://" in name and not name.lower().startswith("file:"):
            from fourpole.io.remote import remote_identity

            return remote_identity(name)
        check_name(name)
        check_name(name.rpartition("#")[0])
        return identity_of(_place(campaign, name))
    return None


def _state(path: Path) -> list[int]:
    """Size, time of change, inode, and the time at which the inode changed, which nobody can state."""
    seen = path.stat()
    return [seen.st_size, seen.st_mtime_ns, seen.st_ino, seen.st_ctime_ns]


def _is_as(path: Path, noted: list[int]) -> bool:
    """Whether a result is in the noted state."""
    try:
        return _state(path) == noted
    except OSError:
        return False


def _holds(campaign: Path, name: str, noted: list[Any] | None, sha256: str, verify: bool) -> bool:
    """Whether an input is as noted, by size, time and inode, or else by its content."""
    found = _identity(campaign, name)
    if found is None or noted is None:
        return found is None and noted is None
    if list(found.parts) == noted and found.settled and not (verify and sha256):
        return True
    if not sha256 or found.size != noted[0] or found.inode == 0:  # what is elsewhere is not fetched for this
        return False
    return sha256_of(_place(campaign, name), max_bytes=_MOST_BYTES, within=campaign) == sha256


@cache
def _programs() -> dict[str, str]:
    """Versions of the programs, and a mark of Fourpole's own files, which a developer changes without a version.

    They are those of this process, which has loaded them; so they are looked up once.
    """
    found = {}
    for name in _PROGRAMS:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    mark = hashlib.sha256()
    for place, folders, files in os.walk(Path(fourpole.__file__).parent):
        folders.sort()
        for name in sorted(files):
            if name.endswith((".py", ".json", ".html", ".css", ".js", ".toml")):
                seen = Path(place, name).stat()
                mark.update(f"{name} {seen.st_size} {seen.st_mtime_ns}\n".encode())
    return {**found, "fourpole": mark.hexdigest()}


#: Exit codes from good to bad; of several campaigns, the worst counts. Any other code is a fault of Fourpole.
_ORDER = (OK, SOME_REJECTED, UNREADABLE)


def run_each(campaigns: Sequence[Path], folder: Path | None, run: Callable[[Path], Answer], *, as_json: bool) -> Answer:
    """Run an analysis for each campaign: its answer, or of several a summary with the worst exit code.

    Parameters
    ----------
    campaigns : sequence of Path
        Campaign folders; one that is named twice is analysed once.
    folder : Path or None
        The folder that --out names.
    run : callable
        Analyses one campaign. Of several, each answer is shown when it is there.
    """
    named = list({resolved(campaign): campaign for campaign in reversed(campaigns)}.values())[::-1]
    if len(named) == 1:
        return run(named[0])
    if folder is not None:
        raise CampaignError("--out is for one campaign: the results of several are in CAMPAIGN/results of each")
    rows: list[dict[str, Any]] = []
    for at, campaign in enumerate(named, 1):
        rows.append(_one(campaign, f"{at} of {len(named)}: {campaign}", run, as_json=as_json))
        if rows[-1]["exit code"] in (STOPPED, TERMINATED):
            break
    codes = (row["exit code"] for row in rows)
    worst = max(codes, key=lambda code: _ORDER.index(code) if code in _ORDER else code + 99)
    return Answer(["", _table(rows)], lambda: {"campaigns": rows}, code=worst)


def _one(campaign: Path, head: str, run: Callable[[Path], Answer], *, as_json: bool) -> dict[str, Any]:
    """Analyse one campaign; an error becomes its message and its exit code."""
    row: dict[str, Any] = {"campaign": str(campaign), "exit code": OK}

    def told() -> int | None:
        try:
            answer = run(campaign)
        except FourpoleError as error:
            row["error"] = str(error)
            raise
        row.update(answer.document() if as_json else _counted(campaign, answer.code))
        return answer.code if as_json else show(answer, as_json=False)

    say(head)
    try:
        with one_of_several(head):
            run_to_exit(told)
    except typer.Exit as end:
        row["exit code"] = end.exit_code
    return row


def _counted(campaign: Path, code: int) -> dict[str, Any]:
    """The number of tests by verdict, from the results that were just written."""
    if code not in (OK, SOME_REJECTED):
        return {}
    from fourpole.io.published import published

    record = published(campaign / "results").record
    return {"verdicts": record["verdicts"]}


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    """A line for each campaign."""
    lines = []
    for row in rows:
        counts = row.get("verdicts", {})
        result = row.get("error") or (f"{row['campaign']}/results" if counts else "not analysed")
        lines.append([row["campaign"], *(str(counts.get(name, "-")) for name in VERDICTS), result])
    return Table(["campaign", *VERDICTS, "results, or why there are none"], lines, VERDICTS)
