"""Compilation of the kernels of state spaces and effects, which the first use compiles otherwise."""

from itertools import product

import numpy as np

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import SimulationContext
from islands.facade.identify import identify_record
from islands.simulators.extended import ExtendedSimulator
from support.built_in_simulators import make_piezo
from support.latent_systems import spring_record


def compile_further_kernels() -> None:
    """Evolve state spaces with a unit, and simulate each effect once for each kind of input."""
    identify_record(spring_record(120), preset="latent", population=4, generations=1, migrate_every=1)
    smooth = np.sin(0.05 * np.arange(300))
    for signal, writeable in product((smooth, np.repeat(smooth[::30], 30)), (True, False)):
        u = signal.copy()
        u.flags.writeable = writeable  # that of a record is not
        channels, units = {"T_K": u, "w_V": u}, {"T_K": "K", "w_V": "V"}
        context = SimulationContext(u, 0.01, channels, units, 1.0, 1.0, "V", "um", 1.0, measured=u)
        for effect in CATALOGUE.values():
            extended = ExtendedSimulator(make_piezo(), (effect,), context)
            values = extended.nominal
            values[extended.get_slice(effect)] = next(iter(effect.starting_points(context, u)))
            extended.simulate(values)
