"""Ways to a SocketCAN bus on which a command can run."""
