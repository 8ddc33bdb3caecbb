"""Runs a recipe on a stage: engine, moves, events, settling statistics."""
