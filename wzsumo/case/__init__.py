"""Joins the stages: one case from its zone to its figures, by each map method."""
