"""The one door to all renderers: a scene and a technique in, a prepared scene or a frame out.

Heavy imports happen here, when a renderer is first used.
"""

from collections.abc import Mapping
from numbers import Integral
from types import TracebackType
from typing import Self

from aliasbench.renderers.frame import Frame, Prepared, Progress
from aliasbench.renderers.soundness import check_scene
from aliasbench.renderers.technique import Technique, parse_technique
from aliasbench.scenes.errors import InputError
from aliasbench.scenes.model import Scene

# Named techniques: what people ask for by name, in every place that takes a technique text.
TECHNIQUES: Mapping[str, str] = {
    "raytrace-1": "raytrace:",
    "raytrace-jittered-4": "raytrace:spp=4,sampler=jittered",
    "raytrace-jittered-16": "raytrace:spp=16,sampler=jittered",
    "raytrace-jittered-64": "raytrace:spp=64,sampler=jittered",
    "raytrace-random-16": "raytrace:spp=16,sampler=random",
    "raytrace-grid-16": "raytrace:spp=16,sampler=grid",
    "raytrace-sobol-16": "raytrace:spp=16,sampler=sobol",
    "raytrace-bluenoise-4": "raytrace:spp=4,sampler=bluenoise",
    "raytrace-gaussian-16": "raytrace:spp=16,sampler=sobol,filter=gaussian",
    "raytrace-adaptive": "raytrace:adaptive=unbiased,sampler=sobol,tolerance=0.02,min_spp=4,max_spp=256",
    "raster-1": "raster:",
    "raster-msaa-4": "raster:msaa=4",
    "raster-passes-4": "raster:passes=4,sampler=jittered",
    "raster-passes-16": "raster:passes=16,sampler=jittered",
    "raster-passes-64": "raster:passes=64,sampler=jittered",
    "raster-fxaa": "raster:post=fxaa",
    "raster-smaa": "raster:post=smaa",
    "raster-taa": "raster:post=taa",
}

MAX_SIDE = 65536
MAX_NUMBER = 2**53  # of frames and seeds: what a float64 time or a JSON record still holds exactly


class CheckedScene:
    """A prepared scene whose arguments are checked in one place, for all renderers; see `frame.Prepared`."""

    __slots__ = ("_inner",)

    def __init__(self, inner: Prepared) -> None:
        self._inner: Prepared | None = inner

    def render(self, frame: int = 0, seed: int = 0, progress: Progress | None = None) -> Frame:
        """Return frame number `frame` under `seed`, both whole numbers from 0 to 2^53.

        `progress`, where given, is told the share of the picture that is done, from 0 to 1, now and then.

        Raises
        ------
        InputError
            For a frame or seed that is no such number.
        RuntimeError
            If the scene was closed.
        """
        if self._inner is None:
            raise RuntimeError("this prepared scene is closed; prepare it again to render")
        for name, value in (("frame", frame), ("seed", seed)):
            if isinstance(value, bool) or not isinstance(value, Integral) or not 0 <= value <= MAX_NUMBER:
                raise InputError(f"{name}={value!s:.60}: must be a whole number from 0 to 2^53")
        told = {} if progress is None else {"progress": progress}
        return self._inner.render(frame=int(frame), seed=int(seed), **told)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._inner is not None:
            inner, self._inner = self._inner, None
            inner.__exit__(kind, error, trace)


def resolve_technique(technique: str | Technique) -> Technique:
    """Return the technique of a text, of a name in `TECHNIQUES`, or itself."""
    if isinstance(technique, Technique):
        return technique
    if not isinstance(technique, str):
        raise TypeError(f"technique must be a Technique or its text, not {type(technique).__name__}")
    return parse_technique(TECHNIQUES.get(technique.strip(), technique))


def prepare(scene: Scene, technique: str | Technique, *, size: tuple[int, int]) -> CheckedScene:
    """Return the scene built and uploaded for a technique, ready to render frame after frame.

    Parameters
    ----------
    scene : Scene
    technique : Technique or str
        A technique, its text, or a name in `TECHNIQUES`.
    size : (width, height)
        In pixels.

    Raises
    ------
    InputError
        For a bad technique text or size.
    UnsupportedScene
        If the renderer cannot do this scene; the message names the feature.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a Scene (see scenes.files.load_scene), not {type(scene).__name__}")
    check_scene(scene)
    return CheckedScene(_prepare(scene, resolve_technique(technique), _checked_size(size)))


def _checked_size(size: tuple[int, int]) -> tuple[int, int]:
    if not isinstance(size, (tuple, list)) or len(size) != 2:
        raise InputError(f"size {size!s:.60}: must be (width, height) in pixels")
    for name, side in zip(("width", "height"), size, strict=True):
        if isinstance(side, bool) or not isinstance(side, Integral) or not 1 <= side <= MAX_SIDE:
            shown = f"{size[0]!s:.20}x{size[1]!s:.20}"
            raise InputError(f"size {shown}: {name} must be a whole number from 1 to {MAX_SIDE}")
    return int(size[0]), int(size[1])


def _prepare(scene: Scene, chosen: Technique, size: tuple[int, int]) -> Prepared:
    if chosen.renderer == "raytrace":
        from aliasbench.renderers.raytrace.tracer import prepare_raytrace

        return prepare_raytrace(scene, chosen, size)
    if chosen.renderer == "raster":
        from aliasbench.renderers.raster.rasterizer import prepare_raster

        return prepare_raster(scene, chosen, size)
    from aliasbench.renderers.reference.reference import prepare_reference

    return prepare_reference(scene, chosen, size)


def render(
    scene: Scene,
    technique: str | Technique,
    *,
    size: tuple[int, int],
    frame: int = 0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Frame:
    """Return one frame: `prepare` and `Prepared.render` at once."""
    with prepare(scene, technique, size=size) as prepared:
        return prepared.render(frame=frame, seed=seed, progress=progress)
