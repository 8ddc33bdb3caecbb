"""The estimator's problem as other packages solve it; `benchmarks/estimator_peers.py` runs them."""
