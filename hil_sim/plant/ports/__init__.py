"""Where effects enter the compiled plant.

`port_arrays` writes the figures of effects into `records`, with the weights of `current_loop`;
`disturbances` evaluates them while the plant is integrated.
"""
