"""Every detector on photographs with known discs."""

import cv2
import numpy as np

from pegpose_lab import study
from pegpose_lab.bench import photographs


def drawn_discs(polarity):
    """An image of two discs, its radius range, polarity and the discs."""
    image = np.full((200, 300), 60, np.uint8)
    for x in (80, 210):
        cv2.circle(image, (x, 100), 30, 190, -1)
    image = cv2.GaussianBlur(image, (0, 0), 1.0)
    known = np.array([[80.0, 100.0, 30.0], [210.0, 100.0, 30.0]])
    return "drawn", f"{polarity}.png", image if polarity == "bright" else 255 - image, (20, 40), polarity, known


def test_discs_of_both_polarities_are_counted(monkeypatch):
    monkeypatch.setattr(study, "pictures_of_discs", lambda: map(drawn_discs, ("bright", "dark")))
    monkeypatch.setattr(photographs.peers, "missing", lambda method: "" if method.module == "cv2" else "absent")
    table = photographs.count_by_methods().set_index("method")
    assert (table["pictures"] == 2).all() and (table["known"] == 4).all()
    ours = table.loc["find_circles, then measured or partial by fit_discs"]
    assert (ours["found"], ours["false"]) == (4, 0)
    assert table.loc["contours + fitEllipse", "found"] == 4
    assert not table.index.isin(["EdgeDrawing", "skimage hough_circle"]).any()


def test_the_best_threshold_of_votes_is_chosen_for_the_set(monkeypatch):
    """The count with the most discs found beyond false circles, whatever the threshold."""
    monkeypatch.setattr(study, "pictures_of_discs", lambda: [drawn_discs("bright")])
    monkeypatch.setattr(photographs.peers, "COMPARED", {})
    counts = {10: (2, 5), 15: (2, 1), 20: (1, 0), 30: (2, 0)}
    monkeypatch.setattr(photographs, "_count", lambda _, method: counts.get(method.options.get("votes"), (0, 0)))
    table = photographs.count_by_methods().set_index("method")
    assert table.loc["HoughCircles, OpenCV's defaults, best votes", ["found", "false"]].tolist() == [2, 0]


def test_the_stored_counts_are_those_of_find_circles():
    """The two tables of the same photographs agree on the discs (a negative's false circles may differ by one)."""
    peers = study.load_measured("peer_counts").query("method == 'find_circles, default'").set_index("dataset")
    counts = study.load_measured("circle_counts").groupby("dataset")[["known", "found"]].sum()
    assert peers[["known", "found"]].sort_index().equals(counts.sort_index())
