"""The paper's two stages for one view: Tsai's linear solution, then a genetic algorithm on (f, T_z).

Other packages import from `pegpose_lab.calibration`.  A new coding of the genes belongs in `genes`, and a new operator
in `operators`.
"""
