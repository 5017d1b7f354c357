"""Laws of long pictures: how far they are is told, and they are as they would be otherwise."""

import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare
from aliasbench.scenes.catalog import SCENES

SIZE = (64, 48)


@pytest.mark.parametrize("engine", ["packet", "portable"])
@pytest.mark.parametrize(
    "technique", ["spp=64", "spp=8,filter=gaussian", "adaptive=pooled,tolerance=0.02,min_spp=4,max_spp=64"]
)
def test_progress_rises_to_the_whole_and_changes_nothing(technique: str, engine: str) -> None:
    shares: list[float] = []
    with prepare(SCENES["edge-fan"].build(), f"raytrace:{technique},engine={engine}", size=SIZE) as prepared:
        told = prepared.render(seed=3, progress=shares.append)
        np.testing.assert_array_equal(told.pixels, prepared.render(seed=3).pixels)
    assert shares == sorted(shares)
    assert shares[0] >= 0.0
    assert shares[-1] == 1.0
