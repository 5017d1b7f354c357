"""Photographed walls that face the camera, too small to be sampled well and panned slowly: even minification.

On a floor every row of pixels is minified by another factor; on a wall all are by the same one, so that a single number
says how many texels a pixel has to average: `height`, the world units from the bottom of the picture to its top. A
photograph is one unit wide; bricks (512 x 512) at height 4 and 256 pixels have eight texels to a pixel and keep none of
their joints steady under point sampling. `page-wall` is a page of printed text (384 x 191), where whole strokes of
letters come and go; `photo-wall` takes the photograph as a parameter.

The camera moves sideways, along the texture's rows, and the picture is the same again after one photograph. It is
orthographic, so that the whole picture has one velocity, opposite to the camera's: that is the pan declared. The
default speeds move it by 0.53 (bricks) and 0.85 pixels a frame at 256 pixels: less than one, as measures of flicker ask
for that know only the pan.
"""

from functools import partial

from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Camera, Facts, PanFact, Scene
from aliasbench.scenes.photographs import load_photograph
from aliasbench.scenes.shapes import quad
from aliasbench.scenes.staging import FPS, loop_frames

# Twice the highest picture, four times as wide as high, and the way of ten seconds at full speed fit in.
HALF_WIDTH, HALF_HEIGHT = 64.0, 16.0
# Texels by which photographs lie right and up of the middle. Without it, pixels of many sizes have their centres on
# texels' borders, where rounding chooses; this is a hundredth of a texel from where they come at the usual sizes and
# speeds (15ths and 100ths of texels from frame to frame).
SHIFT = 0.235
WALL_PHOTOS = ("brick", "camera", "chelsea", "coffee", "coins", "grass", "gravel", "moon", "page", "text")


def build_wall(*, name: str, photo: str, speed: float, height: float, shutter: float) -> Scene:
    """Return the wall before a camera that moves sideways with `speed` (photographs, each 1 unit wide, per second)."""
    texture = load_photograph(photo)
    rows, columns = texture.texels.shape[:2]
    corners = [
        (-HALF_WIDTH, -HALF_HEIGHT, 0.0),
        (HALF_WIDTH, -HALF_HEIGHT, 0.0),
        (HALF_WIDTH, HALF_HEIGHT, 0.0),
        (-HALF_WIDTH, HALF_HEIGHT, 0.0),
    ]
    wall = quad(
        corners,
        uv=[(x - SHIFT / columns, (y * columns - SHIFT) / rows) for x, y, _ in corners],
        texture=photo,
        name="wall",
    )
    camera = Camera(
        projection="orthographic",
        position=(0.0, 0.0, 5.0),
        target=(0.0, 0.0, 0.0),
        height=height,
        velocity=(speed, 0.0, 0.0),
    )
    return Scene(
        name=name,
        camera=camera,
        objects=(wall,),
        textures={photo: texture},
        animation=Animation(fps=float(FPS), frames=loop_frames(speed) if speed else 1, shutter=shutter),
        facts=Facts(pans=(PanFact((-speed, 0.0, 0.0), 1.0 / abs(speed)),) if speed else ()),
    )


_SPEED = Parameter(0.25, -2.0, 2.0, "float", "sideways pan of the camera, photographs per second")
_SHUTTER = Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval")
_SIZE = "world units from bottom to top; a photograph is 1 wide"
_PARAMETERS = {"speed": _SPEED, "height": Parameter(4.0, 0.25, 8.0, "float", _SIZE), "shutter": _SHUTTER}

ENTRIES = (
    SceneEntry(
        "brick-wall",
        "a photograph of bricks, eight texels to a pixel, panned slowly: joints flicker and bend",
        "walls",
        partial(build_wall, photo="brick"),
        _PARAMETERS,
    ),
    SceneEntry(
        "page-wall",
        "a page of printed text, three texels to a pixel, panned slowly: strokes of letters come and go",
        "walls",
        partial(build_wall, photo="page"),
        {
            "speed": Parameter(0.2, -2.0, 2.0, "float", _SPEED.meaning),
            "height": Parameter(2.0, 0.25, 8.0, "float", _SIZE),
            "shutter": _SHUTTER,
        },
    ),
    SceneEntry(
        "photo-wall",
        "a photograph of choice on a wall that faces the camera, panned slowly",
        "walls",
        build_wall,
        {"photo": Choice("page", WALL_PHOTOS, "photograph on the wall"), **_PARAMETERS},
    ),
)
