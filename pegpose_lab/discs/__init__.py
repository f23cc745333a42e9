"""Sub-pixel discs with a sigma for every number: `fit_discs`.

`model` states the model and `measure` leads through the steps: `start`, `fit` on the pixels of a `ring`,
`ground`, and a `refit` by `sectors` where the simple model fails.  A further model of the edge is one file
here.
"""

from .measure import Discs, fit_discs

__all__ = [
    "Discs",
    "fit_discs",
]
