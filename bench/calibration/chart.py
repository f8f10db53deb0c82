"""The figures as one picture: error over bound, time, and the cost of a population."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.calibration.scenes import SETS, SIGMAS


def draw(
    path: Path,
    accuracy: Mapping[str, Mapping[str, Any]],
    times: Mapping[str, Mapping[str, Mapping[str, float]]],
    sizes: Mapping[int, float],
) -> None:
    """Write the chart as a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 9), layout="constrained")
    FigureCanvasAgg(figure)
    (known, free), (time, size) = figure.subplots(2, 2)
    _errors(known, accuracy, "known", ("hybrid", "separable", "cv2.solvePnP SQPNP", "SQPNP + LM"))
    _errors(free, accuracy, "free", ("hybrid", "separable", "DLT + LM", "cv2.calibrateCamera"))
    _times(time, times)
    numbers = list(sizes)
    size.loglog(numbers, list(sizes.values()), "o-", label="a generation of the paper's engine")
    line = [sizes[numbers[0]] * n / numbers[0] for n in numbers]
    size.loglog(numbers, line, "--", color="grey", label="in proportion to the population")
    size.set(xlabel="population", ylabel="ms", title="Cost of a population")
    size.set_xticks(numbers, [str(n) for n in numbers])
    size.minorticks_off()
    size.legend()
    figure.savefig(path, dpi=110, metadata={"Software": None})


def _errors(
    axes: Any, accuracy: Mapping[str, Mapping[str, Any]], kind: str, names: tuple[str, ...]
) -> None:
    """Draw the translation's rms over the bound, a group a cell."""
    cells = [f"{marks}, {sigma:g} px, {kind}" for marks in SETS for sigma in SIGMAS]
    width = 0.8 / len(names)
    for i, name in enumerate(names):
        ratios, bars = [], []
        for cell in cells:
            entry = accuracy[cell].get(name, {}).get("translation_mm", {})
            ratios.append(min(entry.get("over_bound", float("nan")), 3.0))
            bars.append(entry.get("standard_error", 0.0) if ratios[-1] < 3.0 else 0.0)
        places = [k + (i - (len(names) - 1) / 2) * width for k in range(len(cells))]
        axes.bar(places, ratios, width, yerr=bars, label=name)
    axes.axhline(1.0, color="black", linewidth=0.8)
    short = [c.rsplit(",", 1)[0].replace("best seven", "7").replace("ten", "10") for c in cells]
    axes.set_xticks(range(len(cells)), [c.replace(", ", "\n") for c in short])
    axes.set(
        ylabel="translation rms / bound (cut at 3)", title=f"Intrinsics {kind}: marks and noise"
    )
    axes.legend(fontsize=8, loc="lower center")


def _times(axes: Any, times: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    names = [n for n in times if times[n]]
    for offset, kind in ((-0.2, "known"), (0.2, "free")):
        found = {n: [v["ms"] for c, v in times[n].items() if c.endswith(kind)] for n in names}
        drawn = [(k, sum(v) / len(v)) for k, v in enumerate(found.values()) if v]
        axes.barh([k + offset for k, _ in drawn], [v for _, v in drawn], 0.4, label=kind)
    axes.set_yticks(range(len(names)), names)
    axes.set(xscale="log", xlabel="ms a solve, one core", title="Time")
    axes.invert_yaxis()
    axes.legend()
