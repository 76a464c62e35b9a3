import numpy as np
import pytest

from wzsumo.crowd_mapping.drivable_area import driven_lines
from wzsumo.crowd_mapping.mixture import Mixture


def test_line_of_a_component_is_as_long_as_the_uniform_stretch_of_the_same_variance():
    # 60 m uniform along 30 degrees: variance 60^2 / 12 along, 0.2^2 across.
    turn = np.deg2rad(30)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    covariance = axes @ np.diag([60**2 / 12, 0.04]) @ axes.T
    mixture = Mixture(weights=np.ones(1), means=np.array([[5.0, 7.0]]), covariances=covariance[None],
                      log_likelihood=0.0, n_points=1, converged=True)  # fmt: skip
    (line,) = driven_lines(mixture)
    assert np.hypot(*(line[1] - line[0])) == pytest.approx(60)
    assert line.mean(axis=0) == pytest.approx([5, 7])
    assert (line[1] - line[0]) @ axes[:, 1] == pytest.approx(0, abs=1e-9)
