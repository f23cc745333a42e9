"""Visual servoing: a part that the camera sees is moved, frame by frame, until its estimated pose is the wanted one.

`law` has the error and the correction, `loop` leads from frame to frame and says how it ended.  A camera that sees the part
that the robot moves closes the loop: an error of the hand-eye transform then only turns the corrections.  Where the camera
sees only what stands still (a hub on its shaft, and the wheel in the hand unseen), nothing corrects that error, and
`insertion.assembly_forecast` says what is left.
"""

from .law import correction, remaining
from .loop import ServoRun, visual_servo

__all__ = ["ServoRun", "correction", "remaining", "visual_servo"]
