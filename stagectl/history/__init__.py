"""Friction over time and place: what was estimated when, where, and what became of it."""
