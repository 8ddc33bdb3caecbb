"""The blind check of the diagnosis: stages whose effects are drawn and sealed, then diagnosed.

Draws (`moves`, `departing`, `draw`, `stage`) know the library's plausible ranges and the simulator;
they know nothing of how a diagnosis works. `trial` runs one, `score` counts.
"""
