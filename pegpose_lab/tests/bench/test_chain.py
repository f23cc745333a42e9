"""From a frame to a pose, beside a plain pipeline: every method has a row, and the errors are those of its pegs."""

import numpy as np

from pegpose_lab.bench import chain
from pegpose_lab.paper import paper_experiment


def test_every_method_has_its_time_and_its_errors():
    table = chain.measure_chain(3, repeats=1)
    assert list(table.columns) == chain.COLUMNS and table["method"].tolist() == [
        chain.SEARCHED,
        chain.TRACKED,
        chain.PLAIN,
    ]
    assert (table["frames"] == 2).all() and np.allclose(table["frames_per_second"], 1e3 / table["ms"])
    ours, plain = table.iloc[:2], table.iloc[2]
    assert (ours["xy_mm"] < 0.01).all() and plain["xy_mm"] > 2 * ours["xy_mm"].max()
    assert ours["pull"].between(0.2, 3).all() and np.isnan(plain["pull"])


def test_the_plain_pipeline_sees_the_pegs_alone():
    experiment = paper_experiment()
    centers = chain.plain_pegs(experiment.hub_frame(0))
    pegs = experiment.camera.project(experiment.hub.peg_centers, experiment.cam_from_hubs[0])
    assert len(centers) == 4 and np.linalg.norm(pegs[:, None] - centers, axis=2).min(axis=1).max() < 3
