"""What was measured: numbers with 95 % intervals, by name."""

from dataclasses import asdict, dataclass

import numpy as np
from jaxtyping import Float64

RESAMPLES = 1000
WIDE = 1.96  # standard errors on either side of 95 %


@dataclass(frozen=True, kw_only=True)
class Number:
    """A mean or distance, the ends of its 95 % interval, and over how many pictures."""

    value: float
    low: float
    high: float
    count: int


@dataclass(frozen=True, kw_only=True)
class Report:
    """What was measured, by name; `floors` hold the same of real pictures, where that can be measured."""

    numbers: dict[str, Number]
    floors: dict[str, Number]
    left_out: tuple[str, ...]  # what no picture allowed to measure: no true depth, or nobody to see
    seconds: dict[str, float]

    def table(self) -> str:
        """Markdown."""
        lines = ["| metric | value | 95 % | real pictures | pictures |", "|---|---|---|---|---|"]
        for name, number in self.numbers.items():
            floor = f"{self.floors[name].value:.4g}" if name in self.floors else ""
            interval = f"{number.low:.4g} to {number.high:.4g}"
            lines.append(f"| {name} | {number.value:.4g} | {interval} | {floor} | {number.count} |")
        return "\n".join(lines)

    def facts(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)


def distance(value: float, error: float, count: int, least: float = 0.0) -> Number | None:
    """A distance with its interval from its standard error; none where either was not measured."""
    if not np.isfinite([value, error]).all():
        return None
    return Number(value=value, low=max(value - WIDE * error, least), high=value + WIDE * error, count=count)


def mean(values: Float64[np.ndarray, " N"]) -> Number | None:
    """Mean over what was measured (NaN was not), and its interval by resampling pictures; none of nothing."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None
    rng = np.random.default_rng(0)
    means = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return Number(value=float(values.mean()), low=float(low), high=float(high), count=len(values))


def measured(numbers: dict[str, Number | None]) -> dict[str, Number]:
    return {name: number for name, number in numbers.items() if number is not None}
