"""chu2009: the RIM model, the disc, and a reduced run of the experiments."""

from __future__ import annotations

import numpy as np
import pytest

from wayfuse.core.errors import ConfigError
from wayfuse.core.philox import Noise
from wayfuse.evaluation.results_folds import in_turn
from wayfuse.filters.cloud import Cloud
from wayfuse.models.motion.displaced_disc import DisplacedDisc
from wayfuse.papers import chu2009
from wayfuse.simulator.chu2009_world import FieldModel, draw_field, room_walls, walk
from wayfuse.simulator.geometry import crossings


def test_the_pattern_of_irregularity_closes_and_starts_at_one() -> None:
    field = draw_field(FieldModel(grain=5.0, doi=0.01), np.random.default_rng(3))
    assert np.all(field.pattern[:, 0] == 1.0)
    assert np.all(np.abs(field.pattern[:, 0] - field.pattern[:, -1]) <= 0.01)
    assert np.mean(np.abs(np.diff(field.pattern, axis=1))) == pytest.approx(0.01, rel=0.1)  # E of W(1, 1)


def test_levels_follow_path_loss_and_walls() -> None:
    model = FieldModel(n_aps=4, noise=0.0, grain=5.0, doi=0.0, vsp=0.0)
    field = draw_field(model, np.random.default_rng(0))
    at = np.array([[5.0, 15.0], [45.0, 5.0]])  # 10 m in the same room; 40 m behind one wall
    assert len(room_walls()) == 3 * 4 + 2 * 5
    found = field.mean_levels(at)[:, 0]
    assert found[0] == pytest.approx(15.0 - 37.3 - 33.0)
    assert found[1] == pytest.approx(15.0 - 37.3 - 33.0 * np.log10(40.0) - 3.0)


def test_the_walk_passes_no_wall_and_keeps_its_pace() -> None:
    field = draw_field(FieldModel(grain=5.0), np.random.default_rng(1))
    walked = walk(field, np.random.default_rng(2))
    assert walked.xy.shape == (301, 2)
    assert not crossings(walked.xy[:-1], walked.xy[1:], room_walls()).any()
    pace = np.hypot(*walked.moved[1:].T)
    assert np.all(pace <= 1.0 + 1e-9)
    assert np.median(pace) == pytest.approx(1.0)


def test_the_disc_is_uniform_in_radius_and_stays_in_the_field() -> None:
    n = 20_000
    zero = np.zeros(n, np.float32)
    cloud = Cloud.on_floors(zero + 10, zero + 10, zero, zero + 1, zero.astype(np.int32))
    after = DisplacedDisc(r_max=3.0, extent=100.0).propagate(Noise.of(0, "x"), cloud, (1.0, -2.0))
    r = np.hypot(after.x - 11.0, after.y - 8.0)
    assert r.max() <= 3.0 + 1e-5
    assert np.mean(r) == pytest.approx(1.5, abs=0.03)
    assert np.var(after.x) == pytest.approx(1.5, rel=0.05)  # r_max^2 / 6 per axis
    edge = DisplacedDisc(r_max=3.0, extent=100.0).propagate(Noise.of(0, "x"), cloud, (-50.0, 0.0))
    assert edge.x.max() == 0.0
    with pytest.raises(ConfigError, match="r_max"):
        DisplacedDisc(r_max=0.0)


@pytest.mark.slow
def test_the_order_of_the_methods_holds_on_few_seeds() -> None:
    found = chu2009.reproduce(
        (0, 1), in_turn, chu2009.Experiment(seconds=120), chu2009.BuildingExperiment(seconds=200)
    )
    assert [t.title[:10] for t in found.tables] == [
        "Figure 4.3",
        "Figure 4.3",
        "Figure 4.2",
        "Figure 4.5",
    ] + ["Figure 4.6"] * 2 + ["Chapter 5:"] + ["Recovery: "] * 2
    default = next(row for row in found.tables[0].rows if row[0] == "3")
    assert default[4].value < 0.6 * default[3].value + 1.0 < default[2].value + 1.0  # type: ignore[union-attr]
    assert next(bar for bar in found.bars if bar.what == "PFMM: lost runs").met
