"""Friction estimation and feedforward: arrays in, dataclasses out; no files, no clock, no bus."""
