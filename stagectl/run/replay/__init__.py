"""A recorded bus log drives the host again: the first frame that it sends differently is told."""
