"""The laboratory: set-up, results, figures, notebooks and sliders.  It is not part of the method.

Import its files by name (``from pegpose_lab.lab import plotting, results``).  Nothing is imported here, because
`environment` must start on a bare Python.  A new plot belongs in `plotting`, a colour or size in `style`, and a
slider in `widgets`.
"""
