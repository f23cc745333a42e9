"""Figures too long for a cell: one file a notebook, each ``plot_*`` draws into given axes.

What several notebooks draw is in `plotting`.  Nothing is imported here; take a file by its name
(``from pegpose_lab.lab.figures import pose``).
"""
