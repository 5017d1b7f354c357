"""Compiles what most tests call, each kernel once: `make test` runs this first.

Tests run on several processes, and two that come to a kernel at the same time both compile it. Here the ray tracer's
and the references' are compiled side by side, in parts that take about as long; with full caches this is done in
seconds.
"""

import gc
import subprocess
import sys

RAYS = """
edge-fan raytrace:spp=4
brick-floor raytrace:spp=4
propeller:shutter=0.5 raytrace:spp=4
edge-fan raytrace:spp=4,filter=tent
propeller:shutter=0.5 raytrace:spp=4,filter=tent
soft-shadow raytrace:spp=4
edge-fan raytrace:adaptive=unbiased,sampler=sobol
edge-fan raytrace:spp=4,sampler=multijittered
propeller:shutter=0.5 raytrace:spp=4,sampler=multijittered
edge-fan raytrace:spp=4,sampler=multijittered,filter=tent
propeller:shutter=0.5 raytrace:spp=4,sampler=multijittered,filter=tent
soft-shadow raytrace:spp=4,sampler=bluenoise
brick-floor raytrace:spp=4,sampler=multijittered
brick-floor raytrace:texture=ewa
window-screens:kind=cutouts raytrace:spp=4
"""
PORTABLE = """
edge-fan raytrace:spp=4,engine=portable
edge-fan raytrace:spp=4,filter=tent,engine=portable
propeller:shutter=0.5 raytrace:spp=4,engine=portable
soft-shadow raytrace:spp=4,engine=portable
edge-fan raytrace:spp=4,engine=portable,sampler=multijittered
edge-fan raytrace:spp=4,filter=tent,engine=portable,sampler=multijittered
"""
TRUTHS = """
edge-fan reference:
edge-fan reference:filter=tent
brick-floor reference:
checker-floor reference:filter=gaussian
propeller:shutter=0.5 reference:
propeller:shutter=0.5 reference:filter=tent
two-matrices:shutter=0.5 reference:
depth-of-field reference:
soft-shadow reference:
window-screens:kind=cutouts reference:
zone-plate reference:
edge-fan raster:passes=2,filter=lanczos,weighting=distribution
"""


def compile_all(cases: str) -> None:
    """Render every case, a line of scene and technique each, as small as pictures get."""
    gc.set_threshold(50_000, 10, 10)  # compilers make much that stays: looking for garbage was a tenth of the work
    from aliasbench.renderers.catalog import render
    from aliasbench.scenes.files import load_scene

    for line in cases.split("\n"):
        if line:
            scene, technique = line.split()
            render(load_scene(scene), technique, size=(8, 8))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        compile_all({"rays": RAYS, "truths": TRUTHS + PORTABLE}[sys.argv[1]])
    else:
        parts = [subprocess.Popen([sys.executable, __file__, part]) for part in ("rays", "truths")]
        sys.exit(max(part.wait() for part in parts))
