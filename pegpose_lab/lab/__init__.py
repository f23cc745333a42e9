"""The laboratory: set-up, results, figures, notebooks and sliders.  It is no part of the method.

Its files are used by name (``from pegpose_lab.lab import plotting, results``): nothing is imported here,
since `environment` has to start on a bare Python.  A style or a plot belongs into `plotting`, a slider into
`widgets`.
"""
