"""Values that agree with the paper, and where the committed results are."""

from pathlib import Path

import pytest

from pegpose_lab.paper import claims, numbers

PROJECT = Path(claims.__file__).resolve().parents[2]
COMMITTED = PROJECT / "data" / "results"
# Once reproduce has written data/results/claims.csv, what is committed has to be complete and current.
once_reproduced = pytest.mark.skipif(
    not (COMMITTED / "claims.csv").exists(), reason="data/results/claims.csv is not written yet"
)


def as_printed():
    """Values that agree with the paper everywhere, and what the rules need beside them."""
    values = {identifier: numbers.printed(identifier) for identifier in numbers.printed_numbers().index}
    return values | {identifier: 50.0 for identifier in claims.known_identifiers() - set(values)}
