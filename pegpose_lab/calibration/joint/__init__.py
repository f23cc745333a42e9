"""Least squares of all views at once, and what it leaves uncertain.

Other packages use the face of `pegpose_lab.calibration`.  A new lens model for it is a class in `models`.
"""
