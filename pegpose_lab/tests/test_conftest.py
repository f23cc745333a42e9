"""What all tests share: third-party data, and where notebooks write."""

import os
from pathlib import Path

import pytest
from conftest import data_folder

from pegpose_lab.tests.commands import CHECKOUT


@pytest.mark.parametrize("variables", [{"CI": "true"}, {"CI": "true", "PEGPOSE_DATA": ""}])
def test_missing_data_fail_on_ci(variables):
    with pytest.raises(pytest.fail.Exception, match="never skipped"):
        data_folder(variables)


def test_missing_data_skip_elsewhere(tmp_path):
    with pytest.raises(pytest.skip.Exception, match="PEGPOSE_DATA"):
        data_folder({})
    with pytest.raises(pytest.fail.Exception, match="no folder"):
        data_folder({"PEGPOSE_DATA": str(tmp_path / "nowhere")})
    assert data_folder({"PEGPOSE_DATA": str(tmp_path)}) == tmp_path


def test_notebooks_under_test_do_not_write_into_the_checkout():
    output = Path(os.environ["PEGPOSE_OUTPUT"])
    assert (output / "figures").is_dir()
    assert CHECKOUT not in (output, *output.parents)
