import numpy as np
import pytest
from sklearn.mixture import GaussianMixture

from wzsumo.crowd_mapping.mixture.mixture import fit_mixture
from wzsumo.crowd_mapping.mixture.selection import default_k_max, sweep_mixtures
from wzsumo.errors import TraceError


def blobs(k, *, seed):
    """k well separated round clouds of 150 points."""
    random = np.random.default_rng(seed)
    centres = np.stack(np.meshgrid(np.arange(3), np.arange(3)), axis=-1).reshape(-1, 2)[:k] * 30.0
    return np.vstack([c + random.standard_normal((150, 2)) for c in centres])


def road_points(seed):
    random = np.random.default_rng(seed)
    s = random.uniform(0, 400, 2000)
    lane = np.where(random.random(len(s)) < 0.5, 3.6 * np.clip((200 - s) / 80, 0, 1), 0.0)
    return np.column_stack([s, lane - 3 * np.clip((s - 250) / 100, 0, 1) + 0.25 * random.standard_normal(len(s))])


@pytest.mark.parametrize("k", [2, 5, 9])
def test_bic_finds_the_number_of_separated_clouds(k: int) -> None:
    assert sweep_mixtures(blobs(k, seed=k), seed=0, k_max=12).best("bic").n_components == k


@pytest.mark.parametrize("points", [road_points(0), road_points(1), blobs(7, seed=0)], ids=["road", "road", "blobs"])
def test_every_count_is_as_good_as_scikit_learn_from_three_starts(points) -> None:
    ours = sweep_mixtures(points, seed=0, k_max=8).table.set_index("n_components")["bic"]
    for k in range(1, 9):
        theirs = GaussianMixture(k, n_init=3, random_state=0).fit(points).bic(points)
        assert ours[k] <= theirs + 0.001 * abs(theirs)


def test_table_holds_the_criteria_of_the_mixtures() -> None:
    points = blobs(3, seed=1)
    sweep = sweep_mixtures(points, seed=0, k_max=4)
    assert list(sweep.table.columns) == ["n_components", "log_likelihood", "aic", "bic"]
    for row, mixture in zip(sweep.table.itertuples(), sweep.mixtures, strict=True):
        assert row.n_components == mixture.n_components
        assert row.log_likelihood == pytest.approx(mixture.log_density(points).sum(), abs=1e-6)
    assert sweep.best("aic").aic == sweep.table.aic.min()


def test_single_component_equals_the_moments_of_the_points() -> None:
    points = road_points(3)
    one = sweep_mixtures(points, seed=0, k_max=1).mixtures[0]
    np.testing.assert_allclose(one.means[0], points.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(one.covariances[0], np.cov(points.T, ddof=0), atol=1e-4)


def test_same_points_give_the_same_bytes() -> None:
    first, second = (sweep_mixtures(road_points(2), seed=0, k_max=6).best("bic") for _ in range(2))
    assert first.means.tobytes() == second.means.tobytes()


def test_restarts_fit_every_count_on_its_own() -> None:
    points = blobs(4, seed=2)
    sweep = sweep_mixtures(points, seed=7, k_max=5, n_init=4)
    alone = fit_mixture(points, n_components=4, seed=11, n_init=4)
    assert sweep.mixtures[3].bic == alone.bic
    assert sweep.best("bic").n_components == 4


def test_progress_counts_up_to_all_steps() -> None:
    told = []
    sweep_mixtures(blobs(2, seed=0), seed=0, k_max=4, progress=lambda done, total: told.append((done, total)))
    assert [done for done, _ in told] == list(range(len(told)))
    assert told[-1][0] == told[-1][1]


def test_fewer_points_than_components_limit_the_sweep() -> None:
    assert len(sweep_mixtures(np.random.default_rng(0).normal(size=(3, 2)), seed=0, k_max=10).mixtures) == 3


def test_components_grow_with_the_length_of_the_zone() -> None:
    # 30 components on the paper's 657 m (Chen et al. 2022, Figure 5 tries up to 30).
    assert default_k_max(657.0) == 30
    assert default_k_max(1314.0) == 60
    assert default_k_max(0.0) == 2
    assert default_k_max(1e6) == 200


def test_no_component_at_all_is_refused() -> None:
    with pytest.raises(TraceError, match="k_max=-1"):
        sweep_mixtures(blobs(2, seed=0), seed=0, k_max=-1)


def test_lines_of_single_vehicles_in_a_lane_are_not_told_apart_where_no_component_may_be_as_narrow() -> None:
    # Six vehicles, each exactly on a line of its own, 2 cm from the next.
    s, d = np.meshgrid(np.arange(0.0, 120.0, 0.5), 0.02 * np.arange(6))
    points = np.column_stack([s.ravel(), d.ravel()])
    assert sweep_mixtures(points, seed=0, k_max=12).best("bic").n_components == 6
    wide = sweep_mixtures(points, seed=0, k_max=12, reg_covar_m2=0.05**2).best("bic")
    assert wide.n_components < 6
    assert np.linalg.eigvalsh(wide.covariances).min() >= 0.05**2
