"""MapUpdatesSpec: maps that reach the ego while it drives."""

from typing import Literal, Self

from pydantic import Field, model_validator

from wzsumo.spec import Spec


class MapArrivalSpec(Spec):
    """One map of the crowd and when it arrives."""

    after_s: float = Field(ge=0)  # since the ego entered the road
    used: int = Field(ge=1)  # traces that it is made of, the first so many


class MapUpdatesSpec(Spec):
    """The map that the ego sets out with and those that reach it on the way; it plans anew on each."""

    sets_out_with: Literal["crowd", "map_of_before"] = "crowd"  # the map of crowd.used traces, or of the road without the zone
    arrivals: tuple[MapArrivalSpec, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        times = [arrival.after_s for arrival in self.arrivals]
        if times != sorted(set(times)):
            raise ValueError(f"arrivals with after_s {times} must come one after the other; give them in order")
        return self
