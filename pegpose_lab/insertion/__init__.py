"""Insertion of a wheel on the pegs of a hub: its geometry, what is to be expected of it, and the forces of contact.

`wheel` has the part, `sections` the exact geometry of tilted pegs in their holes, `entry` what each peg meets, `leading`
how pegs in their chamfers lead the others, `causes` the covariances, `forecast` the probabilities, and `contact` wedging
and jamming.
"""

from .causes import RP_OF_SIGMA
from .contact import Contacts, can_wedge, jamming_load, two_point_contacts, wedging_depth
from .entry import Entry, peg_entry
from .forecast import AssemblyForecast, assembly_forecast
from .wheel import Wheel, as_pair

__all__ = [
    "RP_OF_SIGMA",
    "AssemblyForecast",
    "Contacts",
    "Entry",
    "Wheel",
    "as_pair",
    "assembly_forecast",
    "can_wedge",
    "jamming_load",
    "peg_entry",
    "two_point_contacts",
    "wedging_depth",
]
