"""Flags: what a user must know of a result, as a sentence with a code."""

from __future__ import annotations


class Flag(str):
    """A warning that comes with a result: a sentence for the reader, and a code for programs.

    ``str(flag)``, ``flag.text`` and the flag itself are the sentence; ``flag.code`` is one of

    ========================  =======================================================================
    loose-focal-length        the 95 % interval of f is wide: f trades off with T_z
    loose-principal-point     the 95 % interval of the principal point is wide
    little-tilt               the planes are only slightly tilted, and f depends on that tilt alone
    noisy-focal-length        much of what the views seem to tell about f may be noise
    misfit-lens               a lens model with more parameters fits the points better
    misfit-board              a board that is bent, or of another aspect ratio, fits the points better
    misfit-view               some views do not fit the others
    misfit-corner             single corners are far from where all others put them
    copied-views              some views are copies of one view
    mirrored-view             planes are seen from behind: the order of their points is mirrored
    clustered-sigmas          a view's errors are not independent; the sigmas are those of the scatter between views
    correlated-corners        a view's errors are not independent, and too few views are there to allow for it
    points-outside            some points lie outside of the image
    size-swapped              the principal point is that of an image with width and height swapped
    short-of-optimum          the genetic algorithm stopped above the optimum of its box
    edge-of-box               the genetic algorithm's solution sits on the edge of its box
    drawn-not-found           the objective is the same everywhere: the solution is arbitrary
    peg-not-measured          one of a hub's pegs is hidden, or its edge could not be measured
    motion-blur               the hub moved during the exposure
    bore-not-measured         the bore was found, but its edge could not be measured
    screw-not-measured        a screw was found, but its edge could not be measured
    place-missing             a place of the ring is empty
    place-contradicted        a place of the ring has a rim that is not that of the ring's discs
    labels-over-gap           labels were carried over frames in which the hub was not found
    labels-undecided          the hub or ring looks the same after a turn, and nothing says which is right
    two-poses                 another pose, tilted the other way, explains the pegs nearly as well
    misfit-pegs               the pegs are not where the pose puts them: part, camera or plane is not as described
    rival-ring                other rings in the picture fit the pattern nearly as well
    further-disc              like discs lie on the ring between its places
    other-proportions         the discs or the bore have another size than the pattern says
    weak-ring                 few places are seen, or their rims are not clear
    ring-misfit               the rims are not those of equal discs in one plane
    steep-view                the ring is seen at a steep angle
    little-turn               the robot turns mostly about one axis, along which the camera's place is weak
    misfit-pose               the robot's other poses do not predict some poses of the target
    target-scale              by the robot's motion the target has another size
    small-lengths             all translations are so small that they must be metres
    unknown                   a sentence alone, as in a file of an earlier version
    ========================  =======================================================================

    Examples
    --------
    >>> from pegpose_lab import Flag
    >>> Flag("edge-of-box", "The solution sits on the edge of its box.").code
    'edge-of-box'
    """

    code: str

    def __new__(cls, code: str, text: str) -> Flag:
        flag = super().__new__(cls, text)
        super().__setattr__(flag, "code", code)
        return flag

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a flag cannot be changed: {name}")

    @property
    def text(self) -> str:
        """The sentence, as a plain str."""
        return str(self)

    def __str__(self) -> str:
        return "".join(self)

    def __getnewargs__(self) -> tuple[str, str]:
        return self.code, str(self)

    def __getstate__(self) -> None:
        return None
