"""Two screens of wires, one behind the other, of slightly different pitch and angle: a true beat among false ones.

Black wires before a white sky. Where wires of one screen cover the gaps of the other it is darker than where they cover
its wires, and the pattern of that, of frequency f1 - f2, is no artifact: it is there at any resolution, with soft
contrast, and every good picture must show it. At the default the wires themselves are just finer than the pixels (33 to
32 pixels at 256 high): in truth they melt into grey, but a point sample turns each screen into false stripes some 30
pixels wide, and lays their beats over the true one. Look at the slanted true bands in the reference, and at what else
there is in a point sample. With `speed` the back screen slides across its wires, and the bands run.

The wires are there as triangles (`kind=polygons`) and as a tiny image whose gaps are cut out (`kind=cutouts`), with the
same edges. `weave=crossed` has wires both ways, each way a layer of its own. Declared are gratings, in this order: the
front screen's frequency f1, the back screen's f2, their beat f1 - f2 (unless it is 0); then, crossed, the same three
for the other direction. The frames hold whole pitches of the back screen: the sequence loops. No pan is declared,
because the picture does not move as a whole.
"""

from aliasbench.scenes.bars import DUTY, Bars, bars_as_mesh, bars_as_quad, cut_out_period, drift_velocity, share_of
from aliasbench.scenes.entries import Choice, Parameter, SceneEntry
from aliasbench.scenes.model import Animation, Facts, GratingFact, Motion, Scene, Surface, Texture, Vec3
from aliasbench.scenes.staging import FPS, flat_camera, loop_frames

PICTURE_HEIGHT = 2.0  # world units
BEHIND = -0.25
LAYER = 2.0**-6  # between the two sets of wires of a crossed screen
BLACK, SKY = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def build_window_screens(
    *,
    name: str,
    wires: float,
    pitch_ratio: float,
    angle_deg: float,
    tilt_deg: float,
    duty: float,
    speed: float,
    weave: str,
    kind: str,
    shutter: float,
) -> Scene:
    """Return a front screen of `wires` to the picture's height and a back screen that slides; see the catalog."""
    share, pitch = share_of(duty), PICTURE_HEIGHT / wires
    objects: list[Surface] = []
    gratings: list[GratingFact] = []
    velocity: Vec3 = (0.0, 0.0, 0.0)
    for turn in (0.0, 90.0) if weave == "crossed" else (0.0,):
        front = Bars(pitch, tilt_deg + turn, share, LAYER * turn / 90.0)
        drift = speed if turn == 0.0 else 0.0
        back = Bars(pitch * pitch_ratio, tilt_deg + angle_deg + turn, share, BEHIND + front.z, drift)
        velocity = drift_velocity(back)
        # wires along the way of the drift need not move with it
        for bars, motion, which in ((back, Motion(velocity=velocity), "back"), (front, Motion(), "front")):
            label = f"{which} wires {'across' if turn else 'upright'}"
            if kind == "polygons":
                objects.append(bars_as_mesh(bars, color=BLACK, motion=motion, name=label))
            else:
                objects.append(bars_as_quad(bars, texture="wire", color=BLACK, motion=motion, name=label))
        (x1, y1), (x2, y2) = front.frequency, back.frequency
        gratings += [GratingFact((x1, y1)), GratingFact((x2, y2))]
        if (x1, y1) != (x2, y2):
            gratings.append(GratingFact((x1 - x2, y1 - y2)))
    textures: dict[str, Texture] = {"wire": cut_out_period(share)} if kind == "cutouts" else {}
    return Scene(
        name=name,
        camera=flat_camera(),
        objects=tuple(objects),
        textures=textures,
        background=SKY,
        animation=Animation(fps=float(FPS), frames=loop_frames(speed) if speed else 1, shutter=shutter),
        facts=Facts(gratings=tuple(gratings)),
    )


ENTRIES = (
    SceneEntry(
        "window-screens",
        "two screens of wires, one behind the other: a true beat among false ones",
        "window_screens",
        build_window_screens,
        {
            "wires": Parameter(264.0, 4.0, 1024.0, "float", "wires of the front screen in the picture's height"),
            "pitch_ratio": Parameter(0.98, 0.5, 2.0, "float", "pitch of the back screen over that of the front one"),
            "angle_deg": Parameter(1.0, -90.0, 90.0, "float", "of the back screen against the front one"),
            "tilt_deg": Parameter(0.0, -90.0, 90.0, "float", "turn of both screens, counter-clockwise"),
            "duty": DUTY,
            "speed": Parameter(1.0, -15.0, 15.0, "float", "slide of the back screen, its own pitches per second"),
            "weave": Choice("upright", ("upright", "crossed"), "wires one way, or both ways"),
            "kind": Choice("polygons", ("polygons", "cutouts"), "triangles, or an image with gaps cut out"),
            "shutter": Parameter(0.0, 0.0, 1.0, "float", "open share of the frame interval"),
        },
    ),
)
