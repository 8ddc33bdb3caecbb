"""Friction of the simulated plant: its laws by name (`laws`), each in a module of its own."""
