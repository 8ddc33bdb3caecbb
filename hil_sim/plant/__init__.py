"""The simulated mechanics with motor, friction, encoder and control loops, compiled."""
