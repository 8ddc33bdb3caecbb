"""What moves the axes, one module per mode of operation, and what stops them."""
