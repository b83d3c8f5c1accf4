"""Two results compared: the difference of each quantity at the conditions that both have, over its uncertainty."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue
from fourpole.core.checks import Verdict
from fourpole.core.condition import AXES, SAME_FREQUENCY, Condition, Sameness
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.sources import Kind
from fourpole.errors import CampaignError
from fourpole.findings.points import QUANTITIES, Common, Readings, differences, none, of_one_campaign, of_two_campaigns
from fourpole.fitting.rows import conditions_in, rule_in
from fourpole.io.folders import resolved, results_in
from fourpole.quantities import LOSS_FACTOR, ShownUnits
from fourpole.study.results import read_results
from fourpole.study.study import Study
from fourpole.units import shown

DIFFERS, NOT_SEEN = "differs", "no difference seen"
#: Head of the ratio of a difference to its standard uncertainty.
RATIO = "z [1]"
#: The quantities of the rows; the loss angle stands for the loss factor.
COMPARED = tuple(quantity for quantity in QUANTITIES if quantity is not LOSS_FACTOR)
_SETTINGS = (q.PRESSURE, q.PRELOAD, q.TEMPERATURE)
_COLUMNS = {
    "specimen": pl.String,
    **{quantity.head: pl.Float64 for quantity in (*_SETTINGS, q.FREQUENCY)},
    "quantity": pl.String,
    "unit": pl.String,
    **dict.fromkeys(("first", "u(first)", "second", "u(second)", "difference", "u(difference)", RATIO), pl.Float64),
    "verdict": pl.String,
    "tests of first": pl.String,
    "tests of second": pl.String,
}
#: The columns that are read, for results without such tests.
_NO_TESTS = {
    **dict.fromkeys((q.TEST.head, q.TYRE.head, q.VERDICT.head, q.ROUTE.head), pl.String),
    **dict.fromkeys((head for quantity in (q.STORAGE, q.LOSS, q.K1, q.K2, q.C) for head in quantity.heads), pl.Float64),
    **dict.fromkeys((q.FREQUENCY.head, q.CORR_K.head), pl.Float64),
}
#: Place of the temperature among the axes of a condition.
_TEMPERATURE = [axis.column for axis in AXES].index(q.TEMPERATURE.head)


@dataclass(frozen=True, eq=False)
class Comparison(ByValue):
    """The second results less the first.

    Attributes
    ----------
    names : (str, str)
        Names of the first and of the second.
    rows : polars.DataFrame
        A row for each quantity of each condition and frequency that both have, the largest ratio first: condition,
        quantity, unit, both values with their standard uncertainties, difference, its standard uncertainty, `z [1]`
        (their ratio), verdict ("differs" beyond 2, else "no difference seen"), and the tests. In SI.
    common : tuple of str
        The errors that are taken as common to both, and why, as sentences.
    shown : ShownUnits
        The units in which the first wants its results shown.
    """

    names: tuple[str, str]
    rows: pl.DataFrame
    common: tuple[str, ...]
    shown: ShownUnits = field(default_factory=ShownUnits)

    @property
    def beyond(self) -> int:
        """Number of rows whose difference is seen."""
        return int((self.rows["verdict"] == DIFFERS).sum())


@dataclass(frozen=True, eq=False)
class _Side:
    """One of both results: its name, its tables, and its specimens by the name that both have."""

    name: str
    results: Study
    specimens: dict[str, str]

    def rows_of(self, table: pl.DataFrame) -> pl.DataFrame:
        """The rows of the specimens that are compared; none, with the columns that are read, without such tests."""
        table = table if q.TYRE.head in table.columns else pl.DataFrame(schema=_NO_TESTS)
        return table.filter(pl.col(q.TYRE.head).is_in(list(self.specimens)))

    def used(self, table: pl.DataFrame, quantity: q.Quantity) -> pl.DataFrame:
        """These rows, of tests that were not rejected and have a quantity."""
        rejected = pl.col(q.VERDICT.head) == Verdict.REJECTED
        return self.rows_of(table).filter(~rejected, pl.col(quantity.head).is_not_null())

    def conditions(self, table: pl.DataFrame, rule: Sameness) -> list[Condition]:
        """The conditions of some rows, with the names of specimens that both results have."""
        return [replace(state, specimen=self.specimens[state.specimen]) for state in conditions_in(table, rule)]


_Sides = tuple[_Side, _Side]


def compare(
    first: str | Path | Study,
    second: str | Path | Study | None = None,
    *,
    specimens: tuple[str, str] | None = None,
    independent: bool = False,
) -> Comparison:
    r"""Compare two runs or two specimens: the second less the first, where common errors cancel.

    .. math:: z = \frac{x_2 - x_1}{u(x_2 - x_1)}, \qquad u^2(x_2 - x_1) = u^2(x_1) + u^2(x_2) - 2\,u(x_1, x_2)

    for x = K1, the modulus of K*, loss angle, K', K'', K2 and C. The covariance u(x1, x2) is that of the errors that
    both share. Two specimens of one campaign share its sensors, rig and weighed masses; the campaign has the
    covariance. Two campaigns share the error of a sensor, a rig's value or a weighed mass if both state it alike; it is
    taken to act in the same direction on both, if K* differs by less than 20 %.

    Parameters
    ----------
    first, second : path or Study
        Results folders or the folders of campaigns; without `second` two specimens of `first` are compared.
    specimens : (str, str), optional
        A specimen of the first and one of the second; by default those whose names both have.
    independent : bool
        Take no error as common, because a sensor or a part of the rig was exchanged or calibrated again.

    Returns
    -------
    Compared

    Raises
    ------
    CampaignError
        If a folder holds no results, a specimen is unknown, or the two have no condition in common.

    Examples
    --------
    >>> compare("results")
    Traceback (most recent call last):
    ...
    fourpole.errors.CampaignError: compare takes two results, or one with two specimens: --specimens X Y
    """
    if isinstance(first, str | Path) and isinstance(second, str | Path) and specimens is None:
        _check_apart(Path(first), Path(second))
    if second is None and specimens is None:
        raise CampaignError("compare takes two results, or one with two specimens: --specimens X Y")
    results = first if isinstance(first, Study) else read_results(first)
    others = results if second is None else second if isinstance(second, Study) else read_results(second)
    sides = _sides((results, others), first, second, specimens)
    errors: Common | None = none
    said: tuple[str, ...] = ("All errors are taken as independent, as asked for.",)
    if not independent:
        errors, said = _of_two(sides) if second is not None else (None, of_one_campaign(results, specimens or ("", "")))
    rows, unlike = _rows(sides, errors, COMPARED)
    if not rows:
        raise CampaignError(_nothing(sides))
    table = _table(rows).sort(pl.col(RATIO).abs(), descending=True, maintain_order=True)
    if unlike and not independent:
        text = f"Where K* differs by more than 20 % ({unlike} pairs), no error of the dynamic tests is taken as common."
        said = (*said, text)
    return Comparison((sides[0].name, sides[1].name), table, said, results.shown)


def compared_by(first: Study, second: Study, common: Common, quantities: Sequence[q.Quantity]) -> pl.DataFrame:
    """Rows as those of `compare` for the specimens that two results have by name, with these common errors."""
    names = {name: name for name in _names(first) if name in _names(second)}
    return _table(_rows((_Side("", first, names), _Side("", second, names)), common, quantities)[0])


def _table(rows: Sequence[dict[str, Any]]) -> pl.DataFrame:
    return pl.DataFrame(rows, schema=_COLUMNS, orient="row")


def _of_two(sides: _Sides) -> tuple[Common, tuple[str, ...]]:
    """Which errors two campaigns have in common, and why; by different routes to K* one error acts differently."""
    bare = [side.name for side in sides if not _budget(side.results).height]
    if bare:
        return none, (f"{' and '.join(bare)}: no budget.csv, so all errors are taken as independent.",)
    routes = [set(side.rows_of(side.results.dynamic)[q.ROUTE.head]) for side in sides]
    if routes[0] == routes[1]:
        return of_two_campaigns(*(side.results for side in sides))
    listed = ", ".join(" and ".join(sorted(names)) or "none" for names in routes)
    text = f"K* was found by different routes ({listed}), where one error acts differently"
    return none, (f"{text}: all errors are taken as independent.",)


def _check_apart(first: Path, second: Path) -> None:
    """CampaignError if both paths are the same results."""
    places = [results_in(path) if path.is_dir() else path for path in (first, second)]
    if resolved(places[0]) == resolved(places[1]):
        raise CampaignError(
            f"{first} and {second} are the same results: name two, or two specimens with --specimens X Y"
        )


# ---- which specimens


def _sides(results: tuple[Study, Study], first: Any, second: Any, specimens: tuple[str, str] | None) -> _Sides:
    """Both sides with the specimens that are compared."""
    known = _names(results[0]), _names(results[1])
    labels = _labels(first, second)
    both = [name for name in known[0] if name in known[1]]
    if specimens is not None:
        for name, there, label in zip(specimens, known, labels, strict=True):
            if name not in there:
                there_are = ", ".join(there) or "none"
                raise CampaignError(f"{label}: has no specimen {shown(name)}: choose one of {there_are}")
        if second is None and specimens[0] == specimens[1]:
            raise CampaignError(f"--specimens names {shown(specimens[0])} twice: name two specimens, or two results")
        pairs, labels = [specimens], specimens if specimens[0] != specimens[1] else labels
    elif both:
        pairs = [(name, name) for name in both]
    elif len(known[0]) == len(known[1]) == 1:
        pairs = [(known[0][0], known[1][0])]
    else:
        raise CampaignError(
            f"no specimen in common: {labels[0]} has {', '.join(known[0])}, {labels[1]} has {', '.join(known[1])}; "
            "name one of each with --specimens X Y"
        )
    names = [", ".join(dict.fromkeys(pair)) for pair in pairs]
    own = [dict(zip(column, names, strict=True)) for column in zip(*pairs, strict=True)]
    return _Side(labels[0], results[0], own[0]), _Side(labels[1], results[1], own[1])


def _names(results: Study) -> list[str]:
    tables = (results.static, results.dynamic)
    return list(dict.fromkeys(name for table in tables if q.TYRE.head in table.columns for name in table[q.TYRE.head]))


def _labels(first: Any, second: Any) -> tuple[str, str]:
    """Short names of both results: the parts in which their paths differ, or "first" and "second"."""
    if not isinstance(first, str | Path) or not isinstance(second, str | Path | None):
        return "first", "second"
    parts = [[part for part in resolved(path).parts if part != "results"] for path in (first, second or first)]
    short = ["/".join(names[-1:]) for names in parts]
    for depth in range(2, 4):
        if short[0] == short[1] and second is not None:
            short = ["/".join(names[-depth:]) for names in parts]
    return short[0], short[1]


# ---- the rows


def _rows(sides: _Sides, common: Common | None, quantities: Sequence[q.Quantity]) -> tuple[list[dict[str, Any]], int]:
    """Rows of the table, and the number of pairs whose K* is too different for a common error."""
    records = [side.results.record for side in sides]
    rule = rule_in(records[0]).over(axis.column for axis in rule_in(records[1]).axes)
    tables = [side.used(side.results.dynamic, q.STORAGE) for side in sides]
    conditions = [side.conditions(table, rule) for side, table in zip(sides, tables, strict=True)]
    groups = _groups(conditions, rule)
    points = [_points(side.results, table, group) for side, table, group in zip(sides, tables, groups, strict=True)]
    static = list(_static_rows(sides, rule, points, common)) if q.K1 in quantities else []
    dynamic, unlike = _dynamic_rows(points, conditions, rule, common, quantities)
    return [*static, *dynamic], unlike


def _dynamic_rows(
    points: Sequence[Readings],
    conditions: Sequence[list[Condition]],
    rule: Sameness,
    common: Common | None,
    quantities: Sequence[q.Quantity],
) -> tuple[list[dict[str, Any]], int]:
    """Rows of all quantities but K1, and the number of pairs whose K* is too different for a common error."""
    members = [_repeats(each, states) for each, states in zip(points, conditions, strict=True)]
    if not all(members):
        return [], 0
    means = [each.means(alike) for each, alike in zip(points, members, strict=True)]
    states = [[own[alike[0]] for alike in each] for own, each in zip(conditions, members, strict=True)]
    pairs = _pairs(means, states)
    if not len(pairs[0]):
        return [], 0
    rows: list[dict[str, Any]] = []
    apart = differences(means[0], means[1], pairs, common)
    stds = [mean.stds[places] for mean, places in zip(means, pairs, strict=True)]
    for pair, places in enumerate(zip(*(side.tolist() for side in pairs), strict=True)):
        tests = [_tests(mean.keys[place]) for mean, place in zip(means, places, strict=True)]
        where = {**_state_of(states[0][places[0]], rule), q.FREQUENCY.head: float(means[0].frequency[places[0]])}
        for column, quantity in enumerate(QUANTITIES):
            if quantity in quantities and quantity is not q.K1:
                place = pair, column
                values = apart.first[place], stds[0][place], apart.second[place], stds[1][place]
                rows += _row(where, quantity, values, apart.u[place], tests)
    return rows, int(apart.unlike.sum()) if common not in (None, none) else 0


def _tests(keys: Sequence[tuple[str, int]]) -> str:
    return "; ".join(dict.fromkeys(test for test, _ in keys))


def _points(results: Study, table: pl.DataFrame, group: np.ndarray) -> Readings:
    """The points of some rows of dynamic.csv."""
    covariance = results.covariance
    return Readings.of(table, _budget(results), group, covariance if covariance.height else None)


def _budget(results: Study) -> pl.DataFrame:
    return results.budget if q.SOURCE.head in results.budget.columns else pl.DataFrame()


def _groups(conditions: Sequence[list[Condition]], rule: Sameness) -> list[np.ndarray]:
    """Number of the group of each condition of both sides; the temperature is held against each other pair by pair."""
    bare = [
        replace(state, values=(*state.values[:_TEMPERATURE], None, *state.values[_TEMPERATURE + 1 :]))
        for states in conditions
        for state in states
    ]
    return np.split(rule.groups(bare) if bare else np.zeros(0, dtype=int), [len(conditions[0])])


def _temperature_near(state: Condition, other: Condition) -> bool:
    """Whether two temperatures are the same; one that is not stated is like every other."""
    return AXES[_TEMPERATURE].same(state.values[_TEMPERATURE], other.values[_TEMPERATURE], blank=True)


def _repeats(points: Readings, states: Sequence[Condition]) -> list[list[int]]:
    """Places of the points of each condition and frequency, by rising condition and frequency."""
    group, frequency = points.group, points.frequency
    repeats: list[list[int]] = []
    for place in np.lexsort((frequency, group)).tolist():
        first = repeats[-1][0] if repeats else None
        if (
            first is not None
            and group[first] == group[place]
            and frequency[place] <= frequency[first] * (1.0 + SAME_FREQUENCY)
            and _temperature_near(states[first], states[place])
        ):
            repeats[-1].append(place)
        else:
            repeats.append([place])
    return repeats


def _pairs(means: Sequence[Readings], states: Sequence[list[Condition]]) -> tuple[np.ndarray, np.ndarray]:
    """Places of each mean of the first and of its nearest one of the second, for those that have one."""
    first, second = means
    members: dict[int, list[int]] = {}
    for place, number in enumerate(second.group.tolist()):
        members.setdefault(number, []).append(place)
    pairs = []
    for i, f in enumerate(first.frequency):
        near = [
            (abs(second.frequency[j] - f), j)
            for j in members.get(int(first.group[i]), [])
            if abs(second.frequency[j] - f) <= SAME_FREQUENCY * max(f, second.frequency[j])
            and _temperature_near(states[0][i], states[1][j])
        ]
        if near:
            pairs.append((i, min(near)[1]))
    both = np.array(pairs, dtype=int).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _static_rows(
    sides: _Sides, rule: Sameness, points: Sequence[Readings], common: Common | None
) -> Iterator[dict[str, Any]]:
    """Rows of K1: one per static condition that both have."""
    gains = [_gain(each) for each in points]
    shared = 1.0 if common is None else common(Kind.K1_GAINS.text)
    tables = [side.used(side.results.static, q.K1) for side in sides]
    conditions = [side.conditions(table, rule) for side, table in zip(sides, tables, strict=True)]
    groups = [group.tolist() for group in _groups(conditions, rule)]
    for number in dict.fromkeys(groups[0]):
        rows = [[row for row, other in enumerate(group) if other == number] for group in groups]
        if not rows[1] or not _temperature_near(conditions[0][rows[0][0]], conditions[1][rows[1][0]]):
            continue
        (first, u_first, tests), (second, u_second, others) = (
            _mean_k1(table[alike]) for table, alike in zip(tables, rows, strict=True)
        )
        cancels = 2.0 * shared * gains[0] * first * gains[1] * second
        std = max(u_first**2 + u_second**2 - cancels, 0.0) ** 0.5
        where = _state_of(conditions[0][rows[0][0]], rule)
        yield from _row(where, q.K1, (first, u_first, second, u_second), std, (tests, others))


def _mean_k1(table: pl.DataFrame) -> tuple[float, float, str]:
    """Mean of K1 and of its standard uncertainty over some rows, and their tests."""
    value, std = (float(table[head].fill_null(0.0).mean()) for head in q.K1.heads)  # type: ignore[arg-type]
    return value, std, "; ".join(dict.fromkeys(table[q.TEST.head]))


def _gain(points: Readings) -> float:
    """Relative standard uncertainty of K1 from the gains of load and deflection [1]; 0 if the budget has none."""
    with np.errstate(invalid="ignore"):
        share = points.k1_gain / points.k1
    known = share[np.isfinite(share) & (share > 0.0)]
    return float(np.median(known)) if known.size else 0.0


def _state_of(state: Condition, rule: Sameness) -> dict[str, Any]:
    """Specimen, and the axes that the rows have a column for."""
    axes = {axis.column: value for axis, value in zip(rule.axes, state.values, strict=True)}
    return {"specimen": state.specimen, **{head: value for head, value in axes.items() if head in _COLUMNS}}


def _row(
    where: dict[str, Any], quantity: q.Quantity, values: Sequence[float], std: float, tests: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """The row of one quantity; none where a value is blank."""
    first, u_first, second, u_second = map(float, values)
    if np.isfinite([first, second, std]).all() and std > 0.0:
        z = (second - first) / float(std)
        yield {
            **dict.fromkeys(_COLUMNS),
            **where,
            "quantity": quantity.column,
            "unit": quantity.unit,
            "first": first,
            "u(first)": u_first,
            "second": second,
            "u(second)": u_second,
            "difference": second - first,
            "u(difference)": float(std),
            RATIO: z,
            "verdict": DIFFERS if abs(z) > COVERAGE_FACTOR else NOT_SEEN,
            "tests of first": tests[0],
            "tests of second": tests[1],
        }


def _nothing(sides: _Sides) -> str:
    """Why there is nothing to compare, with what each has."""
    first, second = sides
    return (
        f"{first.name} and {second.name} have no condition in common (pressure within 2 %, preload and frequency "
        f"within 1 %, temperature within 5 K): {first.name} has {_has(first)}; {second.name} has {_has(second)}"
    )


def _has(side: _Side) -> str:
    table, parts = side.rows_of(side.results.dynamic), []
    for quantity in (*_SETTINGS, q.FREQUENCY):
        values = table[quantity.head].drop_nulls() if quantity.head in table.columns else pl.Series(dtype=pl.Float64)
        if len(values):
            low, high = (float(end) / quantity.scale for end in (values.min(), values.max()))  # type: ignore[arg-type]
            span = f"{low:.4g} to {high:.4g}" if high > 1.001 * low else f"{low:.4g}"
            parts.append(f"{span} {quantity.suffix}")
    return ", ".join(parts) or "no dynamic test"
