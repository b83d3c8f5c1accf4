"""Numbers that decide a doubt about a campaign, or what its files may hold: a case just inside each, one just outside.

The cases have the documented limit as a literal number, so that a limit which only moves fails here.
"""

from tempfile import TemporaryDirectory
from types import SimpleNamespace
from unittest.mock import MagicMock, patch

import pytest

from fourpole.campaign import channels, folder, limits, place, report, row
from fourpole.campaign.folder import doubtful_columns, doubtful_values
from fourpole.campaign.ordinary import doubtful_uncertainties
from fourpole.campaign.schema import ConditionsFile
from fourpole.core.chain import HighPass
from fourpole.errors import CampaignError

HEAD = ["test", "file", "kind", "tyre"]


def taken(function):
    """A function that gives whether another one takes a case without an error."""

    def decided(case):
        try:
            function(case)
        except ValueError:  # a CampaignError, or one of a field
            return False
        return True

    return decided


def doubtful(name, kind, unit="SI"):
    """A function that gives the unit that is probably meant, by the only value of a column; "" for no doubt."""
    column = SimpleNamespace(name=name, unit=unit, kind=kind, role="quantity", label=name)

    def decided(value):
        said = next(doubtful_values([column], [SimpleNamespace(value=lambda name: value)]), "")
        return said and (said.rpartition("[")[2].partition("]")[0] if "is meant" in said else "?")

    return decided


def unsure(gain=0.01, phase=0.01, mass=0.01):
    """Number of doubts about standard uncertainties of a gain, a phase [rad] and a mass, as shares of them."""
    channel = SimpleNamespace(std_gain=gain, std_phase=phase)
    rig = {"moving_mass": SimpleNamespace(value=15.0, std=15.0 * mass)}
    return len(list(doubtful_uncertainties({"force_in": channel}, {"": rig})))


def meant(head):
    """Whether a column is meant as that of the pressure, which is there too."""
    columns = [SimpleNamespace(name="pressure", label="pressure [bar]", role="quantity")]
    columns.append(SimpleNamespace(name="", label=head, role="extra"))
    return bool(list(doubtful_columns(columns, SimpleNamespace(conditions=SimpleNamespace(axes=())))))


def required(label):
    """Whether a column is meant as one that is missing."""
    try:
        row.columns_of(["test", "file", "kind", label])
    except CampaignError as error:
        return "did you mean" in str(error)


def beside(name):
    """Whether the file radial.csv is meant by a name that is not there."""
    folder = MagicMock()
    (folder / name).parent.iterdir.return_value = [place.Path("radial.csv")]
    return "did you mean" in place._likely(folder, name)


def largest(name):
    """Largest size of a file of a campaign [byte]."""

    def text(path, most, *given, **how):
        if path.name == name:
            raise KeyError(most)
        return ""

    with TemporaryDirectory() as made, patch.multiple(folder, statement_text=text, parse_campaign=lambda text: None):
        for file in ("campaign.toml", "tests.csv"):
            (place.Path(made) / file).touch()
        try:
            folder.read_campaign(made)
        except KeyError as found:
            return found.args[0]


def logo(size):
    def read_bytes(path, max_bytes, **how):
        if size > max_bytes:
            raise CampaignError("too large")
        return b"\x89PNG\r\n\x1a\n"

    with patch.multiple(report, read_bytes=read_bytes, inside=lambda *given: None):
        report.logo_of(None, "logo.png")


LIMIT = '[[limits]]\nquantity = "K1"\nhigh = "220 kN/m"\n'
#: Name of the number -> what it decides as a function of a case, and the cases with their decisions.
EDGES = {
    "gain that is not known, 50 %": (lambda x: unsure(gain=x), {0.495: 0, 0.505: 1}),
    "phase that is not known, 0.5 rad": (lambda x: unsure(phase=x), {0.495: 0, 0.505: 1}),
    "mass that is not known, 50 %": (lambda x: unsure(mass=x), {0.495: 0, 0.505: 1}),
    "pressure in another unit, 5 kPa to 2.5 MPa": (
        doubtful("pressure", "pressure", "Pa"), {4950.0: "?", 5050.0: "", 2.475e6: "", 2.525e6: "?"},
    ),
    "pressure that is usual, 0.5 to 15 bar": (
        doubtful("pressure", "pressure", "Pa"), {0.495: "?", 0.505: "bar", 14.9: "bar", 15.1: "psi", 51.0: "kPa"},
    ),
    "preload in another unit, 5 N to 1 MN": (
        doubtful("preload", "force", "N"), {4.95: "kN", 5.05: "", 0.99e6: "", 1.01e6: "?"},
    ),
    "preload that is usual, 50 N to 100 kN": (
        doubtful("preload", "force", "N"), {0.0495: "?", 0.0505: "kN"},
    ),
    "preload that is usual, at most 100 kN": (
        doubtful("preload", "force", "kN"), {0.99e8: "N", 1.01e8: "?"},
    ),
    "temperature in another unit, 200 °C": (
        doubtful("temperature", "temperature", "degC"), {198.0: "", 202.0: "?"},
    ),
    "temperature that is usual, -60 to 150 °C": (
        doubtful("temperature", "temperature", "degC"), {213.0: "?", 214.0: "K", 422.0: "K", 424.0: "?"},
    ),
    "column of one's own that is meant as another, 60 % alike": (meant, {"presx [bar]": True, "presxy [bar]": False}),
    "column that is meant as a required one, 60 % alike": (required, {"tyrabc": True, "tyrabcd": False}),
    "file that is meant, 85 % alike": (beside, {"radiol.csv": True, "radxxl.csv": False}),
    "columns of tests.csv, 1000": (
        taken(lambda n: row.columns_of([*HEAD, *(f"x{at}" for at in range(n - 4))])), {1000: True, 1001: False},
    ),
    "characters of the doubts of a test, 1500": (
        lambda n: len(row.doubts_cell([("", "", "a" * n)])), {1490: 1490, 1510: 0},
    ),
    "characters of a specification, 200": (
        taken(lambda n: limits.read_limits(f'specification = "{"a" * n}"\n{LIMIT}', ())), {200: True, 201: False},
    ),
    "limits, 1000": (taken(lambda n: limits.read_limits(n * LIMIT, ())), {1000: True, 1001: False}),
    "campaign.toml, 1 MB, and tests.csv, 200 MB": (
        largest, {"campaign.toml": 1_000_000, "tests.csv": 200_000_000},
    ),
    "axes of a condition, 20": (
        taken(lambda n: ConditionsFile.model_validate({"axes": [f"axis{at}" for at in range(n)]})),
        {20: True, 21: False},
    ),
    "characters of a particular, 600": (
        taken(lambda n: report.ReportFile.model_validate({"customer": "a" * n})), {600: True, 601: False},
    ),
    "pieces of equipment, 60": (
        taken(lambda n: report.ReportFile.model_validate({"equipment": [{"name": "a"}] * n})), {60: True, 61: False},
    ),
    "order of a filter, 12": (
        taken(lambda n: channels._filter(HighPass)({"corner": "1 Hz", "order": n})), {12: True, 13: False},
    ),
    "logo, 300 kB": (taken(logo), {300_000: True, 300_001: False}),
}  # fmt: skip


@pytest.mark.parametrize(("decided", "cases"), EDGES.values(), ids=EDGES)
def test_a_number_decides_between_two_cases(decided, cases):
    assert {case: decided(case) for case in cases} == cases
