import numpy as np
import pytest
from sklearn.mixture import GaussianMixture

from wzsumo.crowd_mapping.mixture.expectation_maximisation import Fit, run_em
from wzsumo.crowd_mapping.mixture.mixture import mixture_of
from wzsumo.crowd_mapping.mixture.point_blocks import block_points
from wzsumo.crowd_mapping.mixture.selection import default_k_max, sweep_mixtures
from wzsumo.crowd_mapping.mixture.split_and_merge import merges, single_component, splits
from wzsumo.errors import TraceError
from wzsumo.frames import FloatArray


def blobs(k: int, *, seed: int) -> FloatArray:
    """k well separated round clouds of 150 points."""
    random = np.random.default_rng(seed)
    centres = np.stack(np.meshgrid(np.arange(3), np.arange(3)), axis=-1).reshape(-1, 2)[:k] * 30.0
    return np.vstack([c + random.standard_normal((150, 2)) for c in centres])


def road_points(seed: int, n: int = 2000) -> FloatArray:
    random = np.random.default_rng(seed)
    s = random.uniform(0, 400, n)
    lane = np.where(random.random(len(s)) < 0.5, 3.6 * np.clip((200 - s) / 80, 0, 1), 0.0)
    return np.column_stack([s, lane - 3 * np.clip((s - 250) / 100, 0, 1) + 0.25 * random.standard_normal(len(s))])


@pytest.mark.parametrize("k", [2, 5, 9])
def test_bic_finds_the_number_of_separated_clouds(k: int) -> None:
    assert sweep_mixtures(blobs(k, seed=k), k_max=12).best("bic").n_components == k


@pytest.mark.parametrize("points", [road_points(0), road_points(1), blobs(7, seed=0)], ids=["road", "road", "blobs"])
def test_every_count_is_as_good_as_scikit_learn_from_three_starts(points: FloatArray) -> None:
    ours = sweep_mixtures(points, k_max=8).table.set_index("n_components")["bic"]
    for k in range(1, 9):
        theirs = GaussianMixture(k, n_init=3, random_state=0).fit(points).bic(points)
        assert ours[k] <= theirs + 0.001 * abs(theirs)


@pytest.mark.parametrize("seed", [0, 4])
def test_sweep_to_three_components_equals_its_steps_written_out(seed: int) -> None:
    blocks = block_points(road_points(seed, n=7000))
    trial, coarse = blocks.subset(3000), blocks.subset(2000)

    def carried(start: Fit) -> Fit:
        return run_em(blocks, start.components, reg_covar=1e-6, tol=2e-4, max_iterations=100)

    def likeliest(fits: list[Fit]) -> Fit:
        return max(fits, key=lambda fit: fit.log_likelihood)

    fits = [carried(Fit(single_component(blocks, reg_covar=1e-6), 0.0, False))]
    for k in (2, 3):
        starts = splits(fits[k - 2].components, coarse, count=3, reg_covar=1e-6)
        fits.append(carried(likeliest([run_em(trial, s, reg_covar=1e-6, tol=0.0, max_iterations=8) for s in starts])))
    starts = merges(fits[2].components, count=3)
    down = carried(likeliest([run_em(trial, s, reg_covar=1e-6, tol=0.0, max_iterations=8) for s in starts]))
    expected = [mixture_of(blocks, fit) for fit in (fits[0], likeliest([fits[1], down]), fits[2])]
    ours = sweep_mixtures(road_points(seed, n=7000), k_max=3).mixtures
    for got, want in zip(ours, expected, strict=True):
        assert got.means.tobytes() == want.means.tobytes()
        assert got.covariances.tobytes() == want.covariances.tobytes()


def test_table_holds_the_criteria_of_the_mixtures_and_the_best_has_the_lowest() -> None:
    sweep = sweep_mixtures(blobs(3, seed=1), k_max=4)
    assert list(sweep.table.columns) == ["n_components", "log_likelihood", "aic", "bic"]
    assert sweep.table["n_components"].tolist() == [1, 2, 3, 4]
    assert sweep.table["log_likelihood"].tolist() == [mixture.log_likelihood for mixture in sweep.mixtures]
    assert sweep.best("aic").aic == sweep.table["aic"].min()
    assert sweep.best("bic").bic == sweep.table["bic"].min()


def test_single_component_equals_the_moments_of_the_points() -> None:
    points = road_points(3)
    one = sweep_mixtures(points, k_max=1).mixtures[0]
    np.testing.assert_allclose(one.means[0], points.mean(axis=0), atol=1e-9)
    np.testing.assert_allclose(one.covariances[0], np.cov(points.T, ddof=0) + 1e-6 * np.eye(2), rtol=1e-9, atol=1e-9)


def test_same_points_give_the_same_bytes() -> None:
    first, second = (sweep_mixtures(road_points(2), k_max=6).best("bic") for _ in range(2))
    assert first.means.tobytes() == second.means.tobytes()


def test_progress_counts_up_to_all_steps() -> None:
    told: list[tuple[int, int]] = []
    sweep_mixtures(blobs(2, seed=0), k_max=4, progress=lambda done, total: told.append((done, total)))
    # Up through 2, 3, 4, down through 3, 2.
    assert told == [(done, 5) for done in range(6)]


def test_fewer_points_than_components_limit_the_sweep() -> None:
    assert len(sweep_mixtures(np.random.default_rng(0).normal(size=(3, 2)), k_max=10).mixtures) == 3


def test_points_all_in_one_place_keep_the_regularisation_as_covariance() -> None:
    for mixture in sweep_mixtures(np.full((50, 2), 7.0), k_max=2).mixtures:
        np.testing.assert_allclose(mixture.covariances, np.tile(1e-6 * np.eye(2), (len(mixture.weights), 1, 1)), atol=1e-12)
        np.testing.assert_allclose(mixture.means, 7.0, atol=2e-3)


def test_components_grow_with_the_length_of_the_zone() -> None:
    # 30 components on the paper's 657 m (Chen et al. 2022, Figure 5 tries up to 30).
    assert default_k_max(657.0) == 30
    assert default_k_max(1314.0) == 60
    assert default_k_max(0.0) == 2
    assert default_k_max(1e6) == 200


def test_sweep_without_k_max_tries_as_many_components_as_the_length_asks_for() -> None:
    points = np.column_stack([np.linspace(0, 90, 400), np.zeros(400)])
    assert len(sweep_mixtures(points, reg_covar_m2=0.01).mixtures) == 5  # 30 / 657 * 90 m = 4.1


@pytest.mark.parametrize("k_max", [-1, 0])
def test_no_component_at_all_is_refused(k_max: int) -> None:
    with pytest.raises(TraceError, match=f"k_max={k_max} must be 1"):
        sweep_mixtures(blobs(2, seed=0), k_max=k_max)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((5, 3)), "shape \\(5, 3\\) must be \\(n, 2\\)"),
        (np.zeros((0, 2)), "shape \\(0, 2\\) must be \\(n, 2\\), n at least 1"),
        (np.array([[0.0, 1.0], [np.nan, 2.0]]), "point 1 is .*finite"),
    ],
)
def test_points_that_cannot_be_fitted_are_named(points: FloatArray, message: str) -> None:
    with pytest.raises(TraceError, match=message):
        sweep_mixtures(points, k_max=1)


def test_lines_of_single_vehicles_in_a_lane_are_not_told_apart_where_no_component_may_be_as_narrow() -> None:
    # Six vehicles, each exactly on a line of its own, 2 cm from the next.
    s, d = np.meshgrid(np.arange(0.0, 120.0, 0.5), 0.02 * np.arange(6))
    points = np.column_stack([s.ravel(), d.ravel()])
    assert sweep_mixtures(points, k_max=12).best("bic").n_components == 6
    wide = sweep_mixtures(points, k_max=12, reg_covar_m2=0.05**2).best("bic")
    assert wide.n_components < 6
    assert np.linalg.eigvalsh(wide.covariances).min() >= 0.05**2
