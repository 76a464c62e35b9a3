"""Demand and additional files: who drives where, and what each element means once edges are cut."""
