import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from wzsumo.rigid import rotation_from_rpy, rotation_from_vector, rpy_from_rotation, vector_from_rotation

ANGLES = st.floats(-1.5, 1.5)


@given(ANGLES, ANGLES, st.floats(-3.1, 3.1))
def test_rotations_equal_scipy_and_come_back(roll: float, pitch: float, yaw: float) -> None:
    ours = rotation_from_rpy([roll, pitch, yaw])
    np.testing.assert_allclose(ours, Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rpy_from_rotation(ours), [roll, pitch, yaw], atol=1e-9)
    vector = Rotation.from_matrix(ours).as_rotvec()
    np.testing.assert_allclose(rotation_from_vector(vector), ours, atol=1e-12)
    if np.linalg.norm(vector) < 3.1:
        np.testing.assert_allclose(vector_from_rotation(ours), vector, atol=1e-7)
