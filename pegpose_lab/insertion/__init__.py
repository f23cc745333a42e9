"""Insertion of a wheel on the pegs of a hub: its geometry, what is to be expected of it, and the forces of contact.

`wheel` has the part, `sections` the exact geometry of tilted pegs in their holes, `entry` what each peg meets, `causes` the
covariances, `forecast` the probabilities.
"""

from .entry import Entry, peg_entry
from .forecast import AssemblyForecast, assembly_forecast
from .wheel import Wheel

__all__ = ["AssemblyForecast", "Entry", "Wheel", "assembly_forecast", "peg_entry"]
