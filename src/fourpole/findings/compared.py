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
from fourpole.core.condition import Condition, Sameness
from fourpole.core.confidence import COVERAGE_FACTOR
from fourpole.core.sources import Kind
from fourpole.errors import CampaignError
from fourpole.findings.common import none, of_one_campaign, of_two_campaigns
from fourpole.findings.points import QUANTITIES, Common, Points, differences
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
COMPARED = tuple(one for one in QUANTITIES if one is not LOSS_FACTOR)
_COLUMNS = {
    "specimen": pl.String,
    **{one.head: pl.Float64 for one in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE, q.FREQUENCY)},
    "quantity": pl.String,
    "unit": pl.String,
    **dict.fromkeys(("first", "u(first)", "second", "u(second)", "difference", "u(difference)", RATIO), pl.Float64),
    "verdict": pl.String,
    "tests of first": pl.String,
    "tests of second": pl.String,
}
_TEMPERATURE = q.TEMPERATURE.head
#: Two frequencies are the same if they differ by less, relative.
_NEAR = 0.01


@dataclass(frozen=True, eq=False)
class Compared(ByValue):
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


def compare(
    first: str | Path | Study,
    second: str | Path | Study | None = None,
    *,
    specimens: tuple[str, str] | None = None,
    independent: bool = False,
) -> Compared:
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
    one = first if isinstance(first, Study) else read_results(first)
    two = one if second is None else second if isinstance(second, Study) else read_results(second)
    sides = _sides(one, two, first, second, specimens)
    errors: Common | None = none
    said: tuple[str, ...] = ("All errors are taken as independent, as asked for.",)
    if not independent:
        errors, said = _of_two(*sides) if second is not None else (None, of_one_campaign(one, specimens or ("", "")))
    rows, unlike = _rows(*sides, errors, COMPARED)
    if not rows:
        raise CampaignError(_nothing(*sides))
    table = _table(rows).sort(pl.col(RATIO).abs(), descending=True, maintain_order=True)
    if unlike and not independent:
        text = f"Where K* differs by more than 20 % ({unlike} pairs), no error of the dynamic tests is taken as common."
        said = (*said, text)
    return Compared((sides[0].name, sides[1].name), table, said, one.shown)


def compared_by(one: Study, two: Study, common: Common, quantities: Sequence[q.Quantity]) -> pl.DataFrame:
    """Rows as those of `compare` for the specimens that two results have by name, with these common errors."""
    names = [name for name in _names(one) if name in _names(two)]
    sides = [_Side("", results, dict(zip(names, names, strict=True))) for results in (one, two)]
    return _table(_rows(sides[0], sides[1], common, quantities)[0])


def _table(rows: Sequence[dict[str, Any]]) -> pl.DataFrame:
    return pl.DataFrame(rows, schema=_COLUMNS, orient="row")


def _of_two(one: _Side, two: _Side) -> tuple[Common, tuple[str, ...]]:
    """Which errors two campaigns have in common, and why; by different routes to K* one error acts differently."""
    bare = [side.name for side in (one, two) if not _budget(side.results).height]
    if bare:
        return none, (f"{' and '.join(bare)}: no budget.csv, so all errors are taken as independent.",)
    routes = _routes(one, two)
    if routes[0] == routes[1]:
        return of_two_campaigns(one.results, two.results)
    text = f"K* was found by different routes ({', '.join(map(_listed, routes))}), where one error acts differently"
    return none, (f"{text}: all errors are taken as independent.",)


def _check_apart(first: Path, second: Path) -> None:
    """CampaignError if both paths are the same results."""
    places = [results_in(one) if one.is_dir() else one for one in (first, second)]
    if resolved(places[0]) == resolved(places[1]):
        raise CampaignError(
            f"{first} and {second} are the same results: name two, or two specimens with --specimens X Y"
        )


# ---- which specimens


def _sides(one: Study, two: Study, first: Any, second: Any, specimens: tuple[str, str] | None) -> tuple[_Side, _Side]:
    """Both sides with the specimens that are compared."""
    known = _names(one), _names(two)
    labels = _labels(first, second)
    if specimens is not None:
        for name, there, label in zip(specimens, known, labels, strict=True):
            if name not in there:
                there_are = ", ".join(there) or "none"
                raise CampaignError(f"{label}: has no specimen {shown(name)}: choose one of {there_are}")
        if second is None and specimens[0] == specimens[1]:
            raise CampaignError(f"--specimens names {shown(specimens[0])} twice: name two specimens, or two results")
        pairs = {_both(*specimens): specimens}
        named = specimens if specimens[0] != specimens[1] else labels
    else:
        both = [name for name in known[0] if name in known[1]]
        pairs, named = {name: (name, name) for name in both}, labels
        if not both and len(known[0]) == len(known[1]) == 1:
            pairs = {_both(known[0][0], known[1][0]): (known[0][0], known[1][0])}
        elif not both:
            raise CampaignError(
                f"no specimen in common: {labels[0]} has {', '.join(known[0])}, {labels[1]} has {', '.join(known[1])}; "
                "name one of each with --specimens X Y"
            )
    return tuple(
        _Side(named[at], results, {pair[at]: name for name, pair in pairs.items()})
        for at, results in enumerate((one, two))
    )  # type: ignore[return-value]


def _both(first: str, second: str) -> str:
    """The name of what is compared."""
    return first if first == second else f"{first}, {second}"


def _routes(*sides: _Side) -> list[set[str]]:
    """The routes to K* of the specimens of each side."""
    found = []
    for side in sides:
        table = side.results.dynamic
        known = q.TYRE.head in table.columns
        found.append(
            set(table.filter(pl.col(q.TYRE.head).is_in(list(side.specimens)))[q.ROUTE.head]) if known else set()
        )
    return found


def _listed(names: set[str]) -> str:
    return " and ".join(sorted(names)) or "none"


def _names(results: Study) -> list[str]:
    tables = (results.static, results.dynamic)
    return list(dict.fromkeys(name for table in tables if q.TYRE.head in table.columns for name in table[q.TYRE.head]))


def _labels(first: Any, second: Any) -> tuple[str, str]:
    """Short names of both results: the parts in which their paths differ, or "first" and "second"."""
    if not isinstance(first, str | Path) or not isinstance(second, str | Path | None):
        return "first", "second"
    parts = [[part for part in resolved(one).parts if part != "results"] for one in (first, second or first)]
    short = ["/".join(one[-1:]) for one in parts]
    for depth in range(2, 4):
        if short[0] == short[1] and second is not None:
            short = ["/".join(one[-depth:]) for one in parts]
    return short[0], short[1]


# ---- the rows


def _rows(
    one: _Side, two: _Side, common: Common | None, quantities: Sequence[q.Quantity]
) -> tuple[list[dict[str, Any]], int]:
    """Rows of the table, and the number of pairs whose K* is too different for a common error."""
    rule = rule_in(one.results.record).over(axis.column for axis in rule_in(two.results.record).axes)
    points, states = zip(*(_points(side, rule) for side in (one, two)), strict=True)
    numbers = _numbered([*states[0], *states[1]], rule)
    groups = numbers[: len(states[0])], numbers[len(states[0]) :]
    sides = []
    for side, each, state, group in zip((one, two), points, states, groups, strict=True):
        members = _repeats(group, each.frequency, state, rule) if len(state) else []
        mean = replace(each, group=group).means(members) if members else each
        sides.append((side, mean, [state[rows[0]] for rows in members]))
    pairs = _pairs(sides[0], sides[1], rule)
    rows = list(_static_rows(one, two, rule, points, common)) if q.K1 in quantities else []
    if not len(pairs[0]):
        return rows, 0
    found = differences(sides[0][1], sides[1][1], pairs, common)
    u = [mean.stds[at] for (_, mean, _), at in zip(sides, pairs, strict=True)]
    for at, (i, j) in enumerate(zip(*(side.tolist() for side in pairs), strict=True)):
        state, tests = sides[0][2][i], [_tests(mean.keys[k]) for (_, mean, _), k in zip(sides, (i, j), strict=True)]
        where = {**_state_of(state, rule), q.FREQUENCY.head: float(sides[0][1].frequency[i])}
        for column, quantity in enumerate(QUANTITIES):
            if quantity in quantities and quantity is not q.K1:
                values = (found.first[at, column], u[0][at, column], found.second[at, column], u[1][at, column])
                rows += _row(where, quantity, values, found.u[at, column], tests)
    return rows, int(found.unlike.sum()) if common not in (None, none) else 0


def _points(side: _Side, rule: Sameness) -> tuple[Points, list[Condition]]:
    """The points of the dynamic tests that were not rejected, and their conditions under the names that both have."""
    table = side.results.dynamic
    if q.TYRE.head not in table.columns:
        table = pl.DataFrame(schema={**_DYNAMIC, q.TYRE.head: pl.String})
    table = table.filter(
        pl.col(q.VERDICT.head) != Verdict.REJECTED,
        pl.col(q.STORAGE.head).is_not_null(),
        pl.col(q.TYRE.head).is_in(list(side.specimens)),
    )
    covariance = side.results.covariance
    ungrouped = np.zeros(table.height, dtype=int)
    points = Points.of(table, _budget(side.results), ungrouped, covariance if covariance.height else None)
    return points, _renamed(conditions_in(table, rule), side)


_DYNAMIC = {
    **dict.fromkeys((q.TEST.head, q.VERDICT.head), pl.String),
    **dict.fromkeys((one for each in (q.STORAGE, q.LOSS, q.K1, q.K2, q.C) for one in each.heads), pl.Float64),
    **dict.fromkeys((q.FREQUENCY.head, q.CORR_K.head), pl.Float64),
}


def _budget(results: Study) -> pl.DataFrame:
    return results.budget if q.SOURCE.head in results.budget.columns else pl.DataFrame()


def _renamed(conditions: Sequence[Condition], side: _Side) -> list[Condition]:
    return [replace(one, specimen=side.specimens[one.specimen]) for one in conditions]


def _numbered(conditions: Sequence[Condition], rule: Sameness) -> np.ndarray:
    """Number of the group of each condition; the temperature is held against each other pair by pair."""
    at = [axis.column for axis in rule.axes].index(_TEMPERATURE)
    bare = [replace(one, values=(*one.values[:at], None, *one.values[at + 1 :])) for one in conditions]
    return rule.groups(bare) if bare else np.zeros(0, dtype=int)


def _temperature_near(one: Condition, other: Condition, rule: Sameness) -> bool:
    """Whether two temperatures are the same; one that is not stated is like every other."""
    at = [axis.column for axis in rule.axes].index(_TEMPERATURE)
    return rule.axes[at].same(one.values[at], other.values[at], blank=True)


def _repeats(group: np.ndarray, frequency: np.ndarray, states: Sequence[Condition], rule: Sameness) -> list[list[int]]:
    """Places of the points of each condition and frequency, by rising condition and frequency."""
    found: list[list[int]] = []
    for at in np.lexsort((frequency, group)).tolist():
        first = found[-1][0] if found else None
        if (
            first is not None
            and group[first] == group[at]
            and frequency[at] <= frequency[first] * (1.0 + _NEAR)
            and _temperature_near(states[first], states[at], rule)
        ):
            found[-1].append(at)
        else:
            found.append([at])
    return found


def _pairs(first: Any, second: Any, rule: Sameness) -> tuple[np.ndarray, np.ndarray]:
    """Places of each mean of the first and of its nearest one of the second, for those that have one."""
    (_, one, states), (_, two, others) = first, second
    members: dict[int, list[int]] = {}
    for at, number in enumerate(two.group.tolist()):
        members.setdefault(number, []).append(at)
    found = []
    for i in range(len(states)):
        f = one.frequency[i]
        near = [
            (abs(two.frequency[j] - f), j)
            for j in members.get(int(one.group[i]), [])
            if abs(two.frequency[j] - f) <= _NEAR * max(f, two.frequency[j])
            and _temperature_near(states[i], others[j], rule)
        ]
        if near:
            found.append((i, min(near)[1]))
    both = np.array(found, dtype=int).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _static_rows(
    one: _Side, two: _Side, rule: Sameness, points: Sequence[Points], common: Common | None
) -> Iterator[dict[str, Any]]:
    """Rows of K1: one per static condition that both have."""
    gains = [_gain(each) for each in points]
    shared = common is None or common(Kind.K1_GAINS.text)
    tables = [_static(side) for side in (one, two)]
    conditions = [_renamed(conditions_in(table, rule), side) for table, side in zip(tables, (one, two), strict=True)]
    numbers = _numbered([*conditions[0], *conditions[1]], rule)
    groups = numbers[: len(conditions[0])].tolist(), numbers[len(conditions[0]) :].tolist()
    for number in dict.fromkeys(groups[0]):
        rows = [[at for at, one_of in enumerate(group) if one_of == number] for group in groups]
        if not rows[1] or not _temperature_near(conditions[0][rows[0][0]], conditions[1][rows[1][0]], rule):
            continue
        parts = [table[at] for table, at in zip(tables, rows, strict=True)]
        value = [float(part[q.K1.head].mean()) for part in parts]  # type: ignore[arg-type]
        u = [float(part[q.K1.u_head].fill_null(0.0).mean()) for part in parts]  # type: ignore[arg-type]
        cancels = 2.0 * gains[0] * value[0] * gains[1] * value[1] if shared else 0.0
        std = max(u[0] ** 2 + u[1] ** 2 - cancels, 0.0) ** 0.5
        tests = ["; ".join(dict.fromkeys(part[q.TEST.head])) for part in parts]
        where = _state_of(conditions[0][rows[0][0]], rule)
        yield from _row(where, q.K1, (value[0], u[0], value[1], u[1]), std, tests)


def _static(side: _Side) -> pl.DataFrame:
    """The rows of static tests with K1 that were not rejected."""
    table = side.results.static
    if q.TYRE.head not in table.columns:
        return pl.DataFrame(
            schema={**dict.fromkeys((q.TEST.head, q.TYRE.head), pl.String), **dict.fromkeys(q.K1.heads, pl.Float64)}
        )
    kept = pl.col(q.TYRE.head).is_in(list(side.specimens)) & pl.col(q.K1.head).is_not_null()
    return table.filter((pl.col(q.VERDICT.head) != Verdict.REJECTED) & kept)


def _gain(points: Points) -> float:
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


def _tests(keys: Sequence[tuple[str, int]]) -> str:
    return "; ".join(dict.fromkeys(test for test, _ in keys))


def _nothing(one: _Side, two: _Side) -> str:
    """Why there is nothing to compare, with what each has."""
    return (
        f"{one.name} and {two.name} have no condition in common (pressure within 2 %, preload and frequency within "
        f"1 %, temperature within 5 K): {one.name} has {_has(one)}; {two.name} has {_has(two)}"
    )


def _has(side: _Side) -> str:
    table = side.results.dynamic
    if q.TYRE.head not in table.columns:
        return "no dynamic test"
    table = table.filter(pl.col(q.TYRE.head).is_in(list(side.specimens)))
    parts = []
    for one in (q.PRESSURE, q.PRELOAD, q.TEMPERATURE, q.FREQUENCY):
        values = table[one.head].drop_nulls() if one.head in table.columns else pl.Series(dtype=pl.Float64)
        if len(values):
            low, high = float(values.min()) / one.scale, float(values.max()) / one.scale  # type: ignore[arg-type]
            parts.append(f"{low:.4g} to {high:.4g} {one.suffix}" if high > 1.001 * low else f"{low:.4g} {one.suffix}")
    return ", ".join(parts) or "no dynamic test"
