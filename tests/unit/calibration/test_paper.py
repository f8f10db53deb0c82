"""The paper's engine: its trace, its stop, its bounds, its honesty."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from legato.calibration.cost import prepare
from legato.calibration.paper import solve_paper
from legato.calibration.problem import EngineSettings

SHORT = EngineSettings(population=80, generations=300)


def test_best_never_gets_worse_and_the_mean_is_no_better(scenes: Any) -> None:
    """With elites kept the best cost falls monotonically, by orders, under the mean."""
    s = solve_paper(scenes.paper().problem, SHORT, np.random.default_rng(1))
    best, mean = np.array(s.trace.best), np.array(s.trace.mean)
    assert len(best) == len(mean) == s.generations + 1 == 301
    assert (np.diff(best) <= 0.0).all()
    assert (mean >= best).all()
    assert best[-1] < best[0] / 50.0
    assert s.cost == best[-1]
    assert s.stopped_by == "generations"


def test_it_stops_when_the_pose_stays_constant(scenes: Any) -> None:
    """The six pose genes constant for the set number of generations end the search."""
    settings = replace(SHORT, stall_generations=15, stall_tolerance=0.5)
    s = solve_paper(scenes.paper().problem, settings, np.random.default_rng(2))
    assert s.stopped_by == "stalled"
    assert 15 <= s.generations < 300


def test_all_eleven_genes_move_within_their_bounds(scenes: Any) -> None:
    """Known intrinsics are not used: the paper's engine always estimates them."""
    scene = scenes.paper()
    s = solve_paper(scene.known(), SHORT, np.random.default_rng(3))
    box = prepare(scene.problem).search
    assert (s.genes >= box[0]).all()
    assert (s.genes <= box[1]).all()
    assert s.genes[0] != 1.0
    assert s.intrinsics.alpha_u == s.genes[0] * s.genes[1]


def test_the_seed_decides(scenes: Any) -> None:
    """The same seed gives the same genes to the last bit, another seed others."""
    problem = scenes.paper().problem
    settings = replace(SHORT, generations=30)
    one, same, other = (
        solve_paper(problem, settings, np.random.default_rng(seed)) for seed in (4, 4, 5)
    )
    np.testing.assert_array_equal(one.genes, same.genes)
    assert one.trace == same.trace
    assert (one.genes != other.genes).any()


def test_whoever_must_be_heeded_ends_the_search(scenes: Any) -> None:
    """What `heed` raises comes out before the next generation begins."""
    heeded = 0

    def heed() -> None:
        nonlocal heeded
        heeded += 1
        if heeded == 3:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        solve_paper(scenes.paper().problem, replace(SHORT, heed=heed), np.random.default_rng(7))
    assert heeded == 3


def test_what_it_does_not_reach_shows_in_its_sigmas(scenes: Any) -> None:
    """A fit far out of the noise has sigmas as large as its error, so that verify can refuse."""
    scene = scenes.paper("a", sigma=0.05)
    s = solve_paper(scene.problem, SHORT, np.random.default_rng(6))
    _, moved = scene.errors(s.camera_from_object)
    assert s.rms_px > 0.5
    assert s.sigma_translation > moved / 3.0
