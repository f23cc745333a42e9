"""Animated GIFs: fixed palette, same bytes, kept description."""

import numpy as np
import pytest
from PIL import Image, ImageSequence

from pegpose_lab.lab import animation

RED = "#CC0000"


@pytest.fixture(autouse=True)
def _output(tmp_path, monkeypatch):
    monkeypatch.setenv("PEGPOSE_OUTPUT", str(tmp_path))


def pictures(count=3, size=(20, 30)):
    """Grey noise with a red square that moves."""
    rng = np.random.default_rng(0)
    made = []
    for k in range(count):
        picture = np.repeat(rng.integers(0, 256, (*size, 1), np.uint8), 3, axis=2)
        picture[4:8, 4 * k : 4 * k + 4] = (204, 0, 0)
        made.append(picture)
    return made


def test_the_same_pictures_give_the_same_bytes(tmp_path):
    first = animation.save_animation(iter(pictures()), "a", "three, θ = 1.5", colors=[RED]).read_bytes()
    second = animation.save_animation(pictures(), "b", "three, θ = 1.5", colors=[RED])
    assert second == tmp_path / "figures" / "b.gif" and second.read_bytes() == first


def test_frames_times_and_description_are_kept():
    path = animation.save_animation(pictures(), "a", "three, θ = 1.5\n" * 100, colors=[RED], duration=160)
    with Image.open(path) as stored:
        assert (stored.n_frames, stored.size, stored.info["loop"]) == (3, (30, 20), 0)
        assert stored.info["comment"].decode("utf-8") == "three, θ = 1.5\n" * 100
        frames = [
            (frame.info["duration"], np.asarray(frame.convert("RGB"))) for frame in ImageSequence.Iterator(stored)
        ]
    step = 255 / (animation.GREYS - 1)
    for (duration, frame), picture in zip(frames, pictures(), strict=True):
        assert duration == 160
        assert np.abs(frame.astype(int) - picture).max() <= step / 2 + 1


def test_a_grey_stays_a_grey():
    """The first shade of a dull colour is nearer to some greys than the next grey is."""
    ramp = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2)
    path = animation.save_animation([ramp], "a", "ramp", colors=["#505058"])
    with Image.open(path) as stored:
        assert np.ptp(np.asarray(stored.convert("RGB")).astype(int), axis=2).max() == 0


@pytest.mark.parametrize("made", [[], [*pictures(1), *pictures(1, (20, 31))]])
def test_pictures_of_two_sizes_or_none_are_refused(tmp_path, made):
    with pytest.raises(ValueError, match="expected one size of all"):
        animation.save_animation(made, "a", "none")
    assert not list(tmp_path.rglob("*.gif"))
