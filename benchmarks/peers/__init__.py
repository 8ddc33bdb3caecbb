"""The estimator's problem as other packages solve it; `estimation/estimator_peers.py` runs them."""
