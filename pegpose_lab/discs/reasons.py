"""The reasons for which `fit_discs` measures a disc in part only, or not at all, in one place."""

REASONS = (
    "leaves the image",
    "radius too small",
    "no edge",
    "does not converge",
    "edge hidden",
    "contrast below noise",
    "other polarity",
    "chi2",
    "texture",
    "uncertain",
    "same disc",
)
"""Every value that `Discs.reasons` can have, besides "" for a measured disc.  The state is "partial" for those marked *,
where the simple model settled (see `discs.group`), else "rejected":

====================  ==========================================================================
leaves the image      the ellipse, or the circle that was given, does not lie in the image
radius too small      the circle that was given is too small for an ellipse fit
no edge               the image shows no edge that determines an ellipse
does not converge     * the fit does not settle near the circle that was given
edge hidden           * too small a part of the edge fits
contrast below noise  the disc differs from its ground by no more than the noise
other polarity        the disc is dark where a bright one is asked for, or the other way round
chi2                  * the residuals exceed both limits, `max_chi2` and `max_misfit`
texture               * the disc differs from its ground by little more than the ground varies
uncertain             * the sigma of the centre exceeds a quarter of a pixel
same disc             another row measures the same disc
====================  ==========================================================================
"""
