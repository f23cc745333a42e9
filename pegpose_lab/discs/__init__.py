"""Sub-pixel discs with a sigma for every number: `fit_discs`.

`model` states the model, `measure` and `group` lead through the steps: `start`, `fit` on the pixels of a `ring`,
`ground`, and a `refit` by `sectors` where the simple model fails; `correlation` and `spectrum` widen the sigmas
where noise is not white.  `result` has what is returned.  A further model of the edge is one file here.

The constants, with their units and what each is for.  data/measured/disc_constants.csv has what happens to errors and
sigmas when one of them is halved or doubled; those marked * only lay out arrays.

===============  ========  ================================================================================
N_RAYS           rays *    directions in which the start looks for the edge
RAY_POINTS       points *  along each ray, half a pixel apart or less up to radii of 48 px
REMAP_LIMIT      px *      longest side of an image that `cv2.remap` takes
GROUP            px *      sum of radii of the discs fitted together: their arrays stay in the cache
SAME             px        two fits nowhere farther apart are of one disc
REFIT_SIGMAS     sigmas    excess of the simple model's chi2 that calls for a refit by sectors
MAX_STEPS        steps     after which a fit counts as not converging
SMALL_STEP       px        a smaller step is the last: what remains is of its square
MAX_RINGS        rings     a fit that moved by a pixel, or has a wider edge, looks at a new ring: starts off by a fifth need it
WIDE_CHI2        1         chi2 of a wide edge: what disturbs an edge makes it wide, too, but does not fit
FAR              px        residuals of a smoothed or demosaiced image no longer err together at this distance
LEAST_RADIUS     px        smaller discs have too few pixels for sectors
UNCERTAIN        px        sigma of a centre above which nothing was measured to a part of a pixel
TEXTURED         noises    a disc of less contrast over noise that reaches far may be a part of a texture
COARSE           contrast  a disc whose simple model misfits by more is not even measured in part
REACH            px        longest distance at which pixels are taken to err together
SIGNIFICANT      sigmas    of an autocorrelation, below which it counts as 0
HIGHEST          per turn  angular frequency of the edge's displacements; higher ones say little about centre and shape
RISE             1         exponent that takes the excess at these frequencies to that at the lowest
FALL             1         exponent of these frequencies' weights
PARTS            parts *   of an edge, enough for the highest frequency
RING             px        least half width of the ring: three edge widths hold the whole edge, and clutter is farther
RING_WIDTHS      widths    half width of the ring where that is more
CHUNK            px *      pixels in a row of a ring, so that rings of all sizes stand in one array
MOST_KEPT        1 *       numbers of an array whose memory is used again
QUANTISATION     grey^2 *  variance of rounding to whole grey values
GROUND           px        how far from the edge the even ground may help
GROUND_WIDTHS    widths    edge widths between edge and ground: Phi is 0 or 1 there
GROUND_SIGMAS    sigmas    departure that bars ground as uneven
LEAST_GROUND     px        pixels of ground below which its mean and variance say little
NEAR             px        a refit starts from the simple fit only if that is so near the first start,
NEAR_CHI2        1         and its chi2 so small: clutter has not drawn it away
SECTOR_SIGMAS    sigmas    excess of a sector's chi2 that gives it levels of its own
OWN_EXCESS       1         gain in chi2 by own levels that does so, too; their four unknowns alone gain 4
OWN_WEIGHT       1         of a sector with levels of its own: what changes them is seldom straight
ALONE            steps     in which all sectors have levels of their own, unless one is small: the common ones are unknown
FREEZE           steps     after which no sector changes sides, so that the refit converges
LAST_STEP        sigma^2   squared length of the refit's last step
UNEVEN           contrast  how much common levels may change around a disc: freely, they fit what hides its edge
TOLERATED        contrast  departure from the model that is never significant
MIN_VISIBLE      share     of the edge that has to fit
BLOCK            sectors   neighbours that err together
N_SECTORS        sectors * ladder of numbers of sectors, multiples of BLOCK
SECTOR_ROW       px *      length to which the rows of sectors are filled up,
LONGER_ROW       px *      and further in steps of this
SECTOR_LENGTH    px        of a sector along the edge: shorter ones have too few pixels for four levels
===============  ========  ================================================================================
"""

from .measure import Discs, fit_discs

__all__ = [
    "Discs",
    "fit_discs",
]
