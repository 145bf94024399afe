"""he2014 in little: order of Table 1, the motion model from both starts, and the parts of the preset."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.evaluation.results_folds import in_turn
from wayfuse.papers import he2014 as paper
from wayfuse.papers.reproduction import Reproduction, page
from wayfuse.presets import he2014
from wayfuse.radio.gp_field import GpField


@pytest.fixture(scope="module")
def result() -> Reproduction:
    patch = pytest.MonkeyPatch()
    patch.setattr(paper, "VARIANTS", {"coherent sum": paper.VARIANTS["coherent sum"]})
    try:
        return paper.reproduce((0, 1), in_turn)
    finally:
        patch.undo()


def _means(result: Reproduction, table: int, row: int) -> list[float]:
    return [cell.value for cell in result.tables[table].rows[row][1:]]  # type: ignore[union-attr]


def test_more_access_points_help_as_in_table_1(result: Reproduction) -> None:
    none = _means(result, 0, 1)
    assert none[0] > none[1] > none[3]
    assert none == pytest.approx(paper.TABLE_1, rel=0.45)


def test_the_motion_model_keeps_a_known_start_with_any_number_of_access_points(result: Reproduction) -> None:
    known, nearest = _means(result, 0, 3), _means(result, 0, 2)
    assert max(known) < 2.5
    assert nearest[0] > 8.0  # with one access point it does not make up for a wrong start
    assert nearest[3] < 3.0


def test_waves_that_add_up_with_their_phase_do_not_give_the_table(result: Reproduction) -> None:
    assert _means(result, 2, 1)[3] > 1.3 * _means(result, 0, 1)[3]


def test_bars_lost_runs_and_page_are_whole(result: Reproduction) -> None:
    assert len(result.bars) == 15
    assert all(np.isfinite(bar.value) for bar in result.bars)
    assert len(result.lost) == 12
    assert "0 of 8 runs" in result.lost[8]  # one access point, true start
    for word in ("Eq. 1", "Eq. 2", "Eq. 4", "misprint", "(F)", "(T)"):
        assert word in page("he2014")


def test_the_start_is_the_mean_of_the_nearest_fingerprints() -> None:
    places = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [9.0, 9.0]])
    prints = np.array([[-40.0, -60.0], [-42.0, -60.0], [-41.0, -63.0], [-80.0, -80.0]])
    start = he2014.nearest_start(he2014.Config(k=3), places, prints, np.array([-41.0, -60.0]))
    assert start == pytest.approx([1 / 3, 2 / 3])


def test_the_compass_gives_the_first_heading_and_the_gyro_the_others() -> None:
    found = he2014.headings(3.0, np.array([1.0, 1.1, 1.5]))
    assert found == pytest.approx([3.0, 3.1, 3.5 - 2 * np.pi])


def test_a_run_is_the_same_with_the_same_noise_and_starts_at_the_start() -> None:
    slope = np.broadcast_to(-40.0 - np.arange(11.0)[None, :, None], (11, 11, 1))
    field = GpField(np.zeros(2), 1.0, slope, np.ones((11, 11, 1)))
    z = np.full((9, 1), -47.0)
    runs = [
        he2014.track(
            he2014.Config(n_particles=300), field, z, np.array([2.0, 5.0]), [None] * 8, Noise.of(1, "a")
        )
        for _ in range(2)
    ]
    assert np.array_equal(*runs)
    assert runs[0][0].tolist() == [2.0, 5.0]
    assert runs[0][-1, 0] == pytest.approx(7.0, abs=1.0)  # drawn to where the reading fits


def test_impossible_parameters_are_refused() -> None:
    with pytest.raises(ConfigError, match="he2014"):
        he2014.Config(k=0)
