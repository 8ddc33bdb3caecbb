"""One CiA 402 drive: its set-up, units, parameters and the bits of its words."""
