"""Parameters of a mass on a spring with a damper: a part on the carriage, the machine base."""

from __future__ import annotations

from hil_sim.effects.effect import Interval, Parameter


def mode_parameters(
    frequency: tuple[str, Interval],
    damping: tuple[str, Interval],
    mass_ratio: tuple[str, Interval],
) -> tuple[Parameter, ...]:
    """Make the parameters frequency [Hz], damping ratio and mass ratio of one mode.

    Args:
        frequency: meaning and plausible range.
        damping: likewise.
        mass_ratio: likewise.
    """
    return (
        Parameter("frequency", "Hz", *frequency, role="shape", above=0.0, below=1500.0, log=True),
        Parameter("damping", "", *damping, role="shape", least=0.0, below=1.0, log=True),
        Parameter("mass_ratio", "", *mass_ratio, neutral=0.0, least=0.0, below=1.0),
    )
