"""The upload box: what is dropped into it becomes files of its folder, or is refused with a reason."""

import datetime

import cv2
import numpy as np

from pegpose_lab.lab.widgets import upload_box


def uploaded(name, content):
    return {
        "name": name,
        "type": "image/png",
        "size": len(content),
        "content": memoryview(content),
        "last_modified": datetime.datetime(2026, 1, 1),
    }


def test_images_are_written_and_told(tmp_path):
    box = upload_box(tmp_path)
    image = cv2.imencode(".png", np.full((30, 40), 90, np.uint8))[1].tobytes()
    box.buttons["boards"].value = (uploaded("a.png", image), uploaded("broken.png", image[:30]))
    box.buttons["frames"].value = (uploaded("../../outside.png", image),)
    assert [path.name for path in (tmp_path / "boards").iterdir()] == ["a.png"]
    assert [path.name for path in (tmp_path / "frames").iterdir()] == ["outside.png"]
    assert not (tmp_path.parent / "outside.png").exists()
    assert box.text.splitlines()[0] == "a.png: 40 x 30 px" and "broken.png: not taken" in box.text
    assert "a.png" in box.children[1].value
