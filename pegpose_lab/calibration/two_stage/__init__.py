"""The paper's two stages for one view: Tsai's linear solution, then a genetic algorithm on (f, T_z).

Other packages use the face of `pegpose_lab.calibration`.  A new coding of the genes belongs into `genes`,
an operator into `operators`.
"""
