"""Joins the stages: one case, many cases, their report."""
