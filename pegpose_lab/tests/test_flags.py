"""Flags: a sentence with a code, and that every code that is given is explained."""

import copy
import pickle
import re
from pathlib import Path

import pytest

import pegpose_lab
from pegpose_lab import Flag


def test_a_flag_is_its_sentence_and_has_a_code():
    flag = Flag("edge-of-box", "The solution sits on the edge.")
    assert flag == "The solution sits on the edge." == flag.text == str(flag) == f"{flag}" and "edge" in flag
    assert type(flag.text) is str and flag.code == "edge-of-box" and " ".join([flag]) == flag.text
    with pytest.raises(AttributeError):
        flag.code = "another"
    for again in (pickle.loads(pickle.dumps(flag)), copy.deepcopy(flag)):
        assert again == flag and again.code == flag.code and type(again) is Flag


def test_every_code_that_is_given_is_explained():
    package = Path(pegpose_lab.__file__).parent
    sources = "".join(path.read_text() for path in package.rglob("*.py") if "tests" not in path.parts)
    given = set(re.findall(r'[fF]lag(?:ged)?\((?:observation, )?"([\w-]+)"', sources))
    explained = set(re.findall(r"^    ([a-z-]+)  +\w", Flag.__doc__, re.MULTILINE))
    assert len(given) > 8 and given | {"unknown"} == explained
