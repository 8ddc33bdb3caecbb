"""Where the simulator and the stage differ, and why.

The rooms, each importing only from those above it:

- `phases`, `findings`: the phases of motion of a recorded move; what a diagnosis finds
- `gap`: free-run simulation against a recording
- `residuals`: what a model leaves, over velocity and position, at reversals, by frequency
- `audit`: whether the channels mean what the machine file says
- `tracking`: a simulation kept on the recorded course, and its innovations
- `fitting`: the model of one axis fitted to the innovations
- `held_out`: how far a model closes the gap, also on held-out moves
- `dictionary`: where to start fitting each effect, to innovations or in the free loop
- `free_loop`: up to six effects of an axis, fitted and judged in the free closed loop
- `open_loop`: the force along a measured motion, for recordings without a demand
- `rivals`: curves over one coordinate of the motion, which effects have to match to keep names
- `attribution`: which effects explain the gap
- `experiment`: the moves to record next
- `diagnosis`: all of it in order, up to the verdict
- `blind`: the diagnosis checked on sealed stages
"""
