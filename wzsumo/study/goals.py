"""Two goals for one map: the ego's own lane and a lane that stays open. Which of them it is decides what a map must know."""

from dataclasses import asdict, replace
from typing import Any

from wzsumo.metrics.clearance import clearance_along
from wzsumo.metrics.contact import contact_along
from wzsumo.planning.plan import Plan
from wzsumo.study.scenario import Scenario
from wzsumo.study.site import Site


def site_with_open_goal(site: Site) -> Site | None:
    """The site with the goal in the open lane; None where the scenario names none."""
    return None if site.open_goal is None else replace(site, goal=site.open_goal)


def goal_figures(plan: Plan, *, lane: int, scenario: Scenario, site: Site) -> dict[str, Any]:
    """What the planned path to one goal does, as if it were driven exactly and nobody else were on the road."""
    figures: dict[str, Any] = {"lane": lane, "plan_status": str(plan.status), "planned_outcome": "NO_PATH"}
    if plan.path is None:
        return figures | {"reason": plan.reason, "closed_area_share": None, "n_devices_struck": None, "length_m": None}
    poses = plan.path.poses
    contact = contact_along(poses, vehicle=scenario.vehicle, layout=site.layout)
    clearance = clearance_along(poses, vehicle=scenario.vehicle, layout=site.layout)
    return figures | {
        "planned_outcome": str(contact.outcome),
        "first_contact_m": contact.first_contact_m,
        "n_devices_struck": contact.n_devices_struck,
        "length_m": float(plan.path.arc_length[-1]),
        **asdict(clearance),
    }
