"""Where the simulator and the stage differ, and why."""
