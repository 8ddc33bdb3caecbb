"""The device profile of a virtual drive (CiA 402): power states, modes of operation, stops."""
