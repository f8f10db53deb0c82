"""Calibration without pictures: optima, bounds, times, trust, intrinsics; about five minutes."""

import os
from dataclasses import replace

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
    keep(
        "calibration", rows, accuracy=table, times=times, populations=sizes, **trust_more,
        **lens_more,
    )  # fmt: skip
    chart.draw(RESULTS / "calibration.png", table, times, sizes)
    return rows
