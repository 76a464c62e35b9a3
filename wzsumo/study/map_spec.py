"""MapSpec: the cells of the maps."""

import math

from pydantic import Field
from shapely import Polygon

from wzsumo.errors import SpecError
from wzsumo.planning.planning_field import MAX_CELLS
from wzsumo.spec import Spec


class MapSpec(Spec):
    """How large the cells are, and how far they reach beyond the pavement."""

    resolution_m: float = Field(0.127, gt=0, le=1)  # 5 in, the sample of Chen et al. 2022
    margin_m: float = Field(2.0, ge=0)  # beyond the pavement's edges

    def checked(self, ground: Polygon) -> Polygon:
        """The ground that is to be mapped. Raises SpecError where it has more cells than can be planned on."""
        left, low, right, high = ground.bounds
        width, height = right - left, high - low
        n_cells = width * height / self.resolution_m**2
        if n_cells <= MAX_CELLS:
            return ground
        coarser = math.ceil(100 * math.sqrt(width * height / MAX_CELLS)) / 100
        raise SpecError(
            f"map.resolution_m={self.resolution_m:g} makes {n_cells / 1e6:.0f} million cells of the {width:.0f} x {height:.0f} "
            f"m around the road, of which at most {MAX_CELLS / 1e6:.0f} million can be planned on; give {coarser:g} or more"
        )
