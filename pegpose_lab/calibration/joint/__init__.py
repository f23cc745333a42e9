"""Bundle adjustment of all views, and the uncertainty that remains.

Other packages import from `pegpose_lab.calibration`.  A new lens model is a file in `models`.
"""
