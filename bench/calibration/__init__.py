"""Calibration without pictures: optima, bounds, times, trust, intrinsics; about fifteen minutes."""

import math
import os
from dataclasses import replace
from typing import Any

from bench.row import RESULTS, Row, keep


def run() -> list[Row]:
    """Return all rows; the JSON and the chart go to docs/bench/."""
    # One thread a process: peers and engines are compared core for core.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    import cv2

    from bench.calibration import accuracy, chart, lens, speed, trust

    cv2.setNumThreads(1)
    times, sizes, pairs = speed.times(), speed.populations(), speed.pair_stage()
    table = accuracy.measure()
    trust_rows, trust_more = trust.measure()
    lens_rows, lens_more = lens.measure()
    rows = [*accuracy.rows(table), *speed.rows(times, sizes, pairs), *trust_rows, *lens_rows]
    # numpy's numbers compare to numpy's booleans, which JSON does not know.
    rows = [replace(row, value=float(row.value)) for row in rows]
    more = {"accuracy": table, "times": times, "populations": sizes, **trust_more, **lens_more}
    keep("calibration", rows, **plain(more))
    chart.draw(RESULTS / "calibration.png", table, times, sizes)
    return rows


def plain(value: Any) -> Any:
    """Return a document with None for what is not finite: JSON has no word for it."""
    if isinstance(value, dict):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
