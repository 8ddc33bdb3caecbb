"""What a set of effects costs, and what scores make of probabilities.

One model for both searches, by innovations and in the free loop: `penalty` is what effects have to
save, `odds` weighs the sets that were fitted. `constants` holds every figure that was chosen for
selection, names and sigmas.
"""

from sim2real.scoring.odds import weigh_effect as weigh_effect
from sim2real.scoring.penalty import effects_penalty as effects_penalty
