"""A paper lantern that turns: a textured model from a file, as users bring them.

`lantern` is the project's own small glTF model (`assets/make_lantern.py` makes it): pleated paper with a lattice of
thin bars that repeats around it. What models do to a renderer comes together here: the silhouette is a row of short
edges at all angles, the lattice is minified ever more towards the rim, where it breaks up into moire under point
sampling, and as the lantern turns all of it crawls. The frames hold whole turns wherever the rate allows it within ten
seconds. No fact is declared: neither an edge nor a frequency is the same all over a model.
"""

from dataclasses import replace
from functools import lru_cache

from aliasbench.scenes.assets.make_lantern import PATH
from aliasbench.scenes.entries import Parameter, SceneEntry
from aliasbench.scenes.framing import frame_surfaces
from aliasbench.scenes.meshes import MeshFile, load_mesh
from aliasbench.scenes.model import Animation, Motion, Scene, Spin
from aliasbench.scenes.staging import FPS, loop_frames


def build_lantern(*, name: str, rev_per_s: float, shutter: float) -> Scene:
    """Return the lantern turning about its upright axis; see the catalog for the parameters."""
    model = lantern_model()
    motion = Motion(spin=Spin((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), rev_per_s)) if rev_per_s else Motion()
    turned = Motion(spin=Spin((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), 1.0))
    return Scene(
        name=name,
        # The same camera at every rate: it has a whole turn in view.
        camera=frame_surfaces([replace(s, motion=turned) for s in model.surfaces], Animation(frames=FPS)),
        objects=tuple(replace(surface, motion=motion) for surface in model.surfaces),
        textures=model.textures,
        background=(0.02, 0.03, 0.06),
        animation=Animation(fps=float(FPS), frames=loop_frames(rev_per_s) if rev_per_s else 1, shutter=shutter),
    )


@lru_cache(maxsize=1)
def lantern_model() -> MeshFile:
    """Return the model, read once."""
    return load_mesh(PATH)


ENTRIES = (
    SceneEntry(
        "lantern",
        "a textured model that turns: its lattice breaks up towards the rim, its pleated outline crawls",
        "lantern",
        build_lantern,
        {
            "rev_per_s": Parameter(0.25, -60.0, 60.0, "float", "turns per second, counter-clockwise seen from above"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
