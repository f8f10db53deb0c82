"""Figures counted one by one: how many, their mean, spread and ends, without keeping them."""

from dataclasses import dataclass
from math import sqrt
from typing import Any


@dataclass
class Spread:
    """What is known of all figures so far (Welford's running sums)."""

    count: int = 0
    mean: float = 0.0
    squares: float = 0.0  # of the distances from the mean
    least: float = float("inf")
    most: float = float("-inf")

    def add(self, figure: float) -> None:
        """Count one figure."""
        self.count += 1
        off = figure - self.mean
        self.mean += off / self.count
        self.squares += off * (figure - self.mean)
        self.least, self.most = min(self.least, figure), max(self.most, figure)

    def told(self) -> dict[str, Any]:
        """Return count, mean, standard deviation (None below two), least and most, in mm."""
        sigma = sqrt(self.squares / (self.count - 1)) if self.count > 1 else None
        return {
            "count": self.count,
            "mean_mm": self.mean,
            "sigma_mm": sigma,
            "least_mm": self.least,
            "most_mm": self.most,
        }
