"""Self-contained HTML reports of runs: one file, no network, readable on a projector."""
