"""What many campaigns say together: root mean square of error over uncertainty, coverage, efficiency."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

__all__ = ["NEAR_POLE", "Sample", "against_bound", "collect", "coverage_table", "exact_limits"]

Array = NDArray[np.float64]

#: Uncertainty over value beyond which linear propagation is not to be believed, and rows are counted apart.
NEAR_POLE = 0.3
_INSIDE = float(stats.norm.ppf(0.975))
_SEED = 1982


class Sample:
    """Errors over uncertainty of one quantity, campaign by campaign."""

    def __init__(self) -> None:
        self.campaigns: list[Array] = []
        self.far: list[Array] = []

    def add(self, z: Sequence[float | None], relative: Sequence[float | None] | None) -> None:
        """The rows of one campaign; those whose uncertainty is too large a share of the value go apart."""
        values = np.array([np.nan if value is None else value for value in z])
        apart = np.zeros(values.size, dtype=bool)
        if relative is not None:
            apart = np.array([value is not None and value > NEAR_POLE for value in relative])
        here = np.isfinite(values)
        if (here & ~apart).any():
            self.campaigns.append(values[here & ~apart])
        if (here & apart).any():
            self.far.append(values[here & apart])

    @property
    def rows(self) -> int:
        """How many there are."""
        return sum(each.size for each in self.campaigns)

    def rms(self) -> tuple[float, float]:
        """With its standard uncertainty; rows of a campaign share their errors, so that campaigns are counted."""
        mean, u = _mean([each**2 for each in self.campaigns])
        return float(np.sqrt(mean)), u / (2 * float(np.sqrt(mean)))

    def coverage(self) -> tuple[float, float]:
        """Share of errors within 1.96 uncertainties, with its standard uncertainty, counted in the same way."""
        return _mean([(np.abs(each) < _INSIDE).astype(float) for each in self.campaigns])

    def one_each(self) -> tuple[int, int]:
        """How many of one row per campaign, drawn with a fixed seed, are inside; and of how many."""
        rng = np.random.default_rng(_SEED)
        drawn = [abs(float(rng.choice(each))) < _INSIDE for each in self.campaigns]
        return sum(drawn), len(drawn)


def _mean(groups: list[Array]) -> tuple[float, float]:
    """Mean of all values, and its standard uncertainty where values of a group may go together."""
    total, size = np.array([each.sum() for each in groups]), np.array([each.size for each in groups])
    mean = float(total.sum() / size.sum())
    return mean, float(np.sqrt(np.sum((total - mean * size) ** 2)) / size.sum())


def exact_limits(inside: int, count: int) -> tuple[float, float]:
    """95 % limits of a share, by the binomial law (Clopper and Pearson)."""
    low = stats.beta.ppf(0.025, inside, count - inside + 1) if inside else 0.0
    high = stats.beta.ppf(0.975, inside + 1, count - inside) if inside < count else 1.0
    return float(low), float(high)


def collect(results: Iterable[Mapping[str, Any]]) -> dict[str, Sample]:
    """Samples of each quantity, and of all outputs together."""
    samples: dict[str, Sample] = {}
    for result in results:
        for name, z in result["z"].items():
            samples.setdefault(name, Sample()).add(z, result["relative"].get(name))
    return samples


def coverage_table(samples: Mapping[str, Sample], names: Sequence[str]) -> list[str]:
    """Lines of a table in Markdown, one per quantity that was met."""
    heads = (
        "quantity",
        "campaigns",
        "rows",
        "rms of error / u",
        "within 1.96 u",
        "one row of each",
        "its limits",
        "apart",
    )
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for name in names:
        sample = samples.get(name)
        if sample is None or len(sample.campaigns) < 2:
            continue
        rms, u_rms = sample.rms()
        share, u_share = sample.coverage()
        inside, count = sample.one_each()
        low, high = exact_limits(inside, count)
        far = np.concatenate([np.zeros(0), *sample.far])
        apart = f"{far.size}, {100 * np.mean(np.abs(far) < _INSIDE):.0f} % within" if far.size else "0"
        lines.append(
            f"| {name} | {count} | {sample.rows} | {rms:.3f} ± {2 * u_rms:.3f} | "
            f"{100 * share:.1f} ± {200 * u_share:.1f} % | {100 * inside / count:.1f} % | "
            f"{100 * low:.1f} to {100 * high:.1f} % | {apart} |"
        )
    return lines


def against_bound(results: Iterable[Mapping[str, Any]], names: Sequence[str]) -> list[str]:
    """Lines of a table: stated uncertainty over the least possible, by quantity."""
    ratios: dict[str, list[float]] = {}
    count = 0
    for result in results:
        if "bound" not in result:
            continue
        count += 1
        for name, values in result["bound"].items():
            relative = result["relative"].get(name, [0.0] * len(values))
            ratios.setdefault(name, []).extend(
                value
                for value, share in zip(values, relative, strict=True)
                if value is not None and share is not None and share <= NEAR_POLE
            )
    lines = [f"| quantity ({count} campaigns) | rows | 5 % | median | 95 % |", "|---|---|---|---|---|"]
    for name in names:
        if ratios.get(name):
            low, middle, high = np.quantile(ratios[name], [0.05, 0.5, 0.95])
            lines.append(f"| {name} | {len(ratios[name])} | {low:.3f} | {middle:.3f} | {high:.3f} |")
    return lines
