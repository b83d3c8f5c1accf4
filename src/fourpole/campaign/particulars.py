"""What a test report must say of laboratory, customer, items and method, as [report] of campaign.toml states it.

The items are those of ISO/IEC 17025:2017, 7.8.2.
"""

from __future__ import annotations

import base64
import datetime as dt
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from fourpole import units
from fourpole.campaign.channels import File
from fourpole.campaign.place import inside
from fourpole.errors import CampaignError, FourpoleError
from fourpole.io.door import read_bytes

#: Characters of one statement, and pieces of equipment.
_MOST_TEXT, _MOST_EQUIPMENT = 600, 60
#: Size of the file of a logo [byte].
_MOST_LOGO = 300_000
#: First bytes of the images that a logo may be, and their kinds.
_IMAGES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}


def _text(raw: Any) -> Any:
    """A text without outer blanks; a date of TOML as its text, so that a span of days can be stated as well."""
    if isinstance(raw, dt.date | dt.datetime):
        return raw.isoformat(" ") if isinstance(raw, dt.datetime) else raw.isoformat()
    if not isinstance(raw, str):
        raise ValueError(f"must be a text in quotation marks, not {raw!r}")
    text = raw.strip()
    if len(text) > _MOST_TEXT:
        raise ValueError(f"has {len(text)} characters, at most {_MOST_TEXT} are taken")
    return text


def _frequency(raw: Any) -> float:
    found = units.quantity(raw, "frequency")
    if found <= 0:
        raise ValueError('must be positive, as "15 Hz"')
    return found


Text = Annotated[str, BeforeValidator(_text)]


class Equipment(File):
    """[[report.equipment]]: one instrument with its calibration certificate, and the day until which that holds."""

    name: Text
    serial: Text = ""
    certificate: Text = ""
    due: Text = ""


class Particulars(File):
    """The particulars of a test report, all of them optional; what is not stated stays blank.

    `received`, `tested` and `issued` are days, or a text such as "2026-11-02 to 2026-11-05".
    """

    laboratory: Text = ""
    address: Text = ""
    operator: Text = ""
    customer: Text = ""
    number: Text = ""
    replaces: Text = ""
    received: Text = ""
    tested: Text = ""
    issued: Text = ""
    method: Text = ""
    deviations: Text = ""
    environment: Text = ""
    conditioning: Text = ""
    break_in: Text = ""
    sampling: Text = ""
    location: Text = ""
    external: Text = ""
    from_customer: Text = ""
    approved: Text = ""
    logo: Text = ""
    equipment: Annotated[tuple[Equipment, ...], Field(max_length=_MOST_EQUIPMENT)] = ()
    frequency: Annotated[float | None, BeforeValidator(_frequency)] = None


def logo_of(folder: Path, file: str) -> str:
    """The image of a file of the campaign as a data: URL; empty without a file.

    Raises
    ------
    CampaignError
        If the file is not there, lies outside the folder, is too large, or is no PNG, JPEG or SVG.
    """
    if not file:
        return ""
    try:
        content = read_bytes(inside(folder, file), max_bytes=_MOST_LOGO, label=file, within=folder)
    except FourpoleError as error:
        raise CampaignError(f"campaign.toml: [report] logo: {error}") from None
    kind = next((kind for start, kind in _IMAGES.items() if content.startswith(start)), "")
    if not kind and b"<svg" in content[:2000]:
        kind = "image/svg+xml"
    if not kind:
        raise CampaignError(f"campaign.toml: [report] logo: {units.shown(file)} is no PNG, JPEG or SVG image")
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
