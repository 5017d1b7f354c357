"""Which two pictures show what a metric means: one that scores low and one that scores high, and what to look at.

Scenes of the catalog, small, so that a pixel can be shown several times as wide, and by renderers that work on every
machine. Scores are not written here: they are measured on the very pictures that a page shows.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Shot:
    """What is rendered: a scene and a technique, as the command line takes them."""

    scene: str
    technique: str


@dataclass(frozen=True, slots=True)
class Pair:
    """Two shots for one metric.

    Attributes
    ----------
    low, high : Shot
        The one with the smaller score and the one with the larger (nearer to and farther from 0 of signed ones).
    look : str
        A sentence: what the eye should look for.
    side : int
        Width and height of the pictures in pixels; what is shown is what is measured.
    frames, seeds : int
        How many are rendered and measured; several frames are shown as a film, of several seeds the first.
    frame_ms : int
        How long a frame of the film is shown; strobing needs the scene's own rate, the rest is easier to see slowly.
    """

    low: Shot
    high: Shot
    look: str
    side: int = 80
    frames: int = 1
    seeds: int = 1
    frame_ms: int = 100


POINT, STRATIFIED = "raytrace:", "raytrace:spp=16"
EXACT, WIDE = "reference:", "reference:filter=gaussian,sigma=1.5,radius=6"
REAL_TIME_MS = 33


def _by(scene: str, low: str, high: str) -> tuple[Shot, Shot]:
    return Shot(scene, low), Shot(scene, high)


PAIRS: Mapping[str, Pair] = MappingProxyType(
    {
        "rmse": Pair(
            *_by("edge-fan", STRATIFIED, POINT), "Pixels on a border are grey on the left, black or white on the right."
        ),
        "psnr": Pair(*_by("zone-plate:k=800", POINT, STRATIFIED), "Only the rings in the middle are true."),
        "relmse": Pair(
            *_by("colour-bleeding:bounces=0", STRATIFIED, "raytrace:sampler=random"),
            "Grain on the dark wall and in the shadow counts as much as grain on the lamp.",
        ),
        "max_error": Pair(
            *_by("slivers:count=32,narrowest_px=0.2,widest_px=2", "raytrace:spp=64", POINT),
            "Rays thinner than a pixel break into dots: each dot is an error of nearly all the contrast.",
        ),
        "ssim": Pair(*_by("brick-floor", POINT, STRATIFIED), "Do the joints of the bricks stand where they should?"),
        "jaggies": Pair(*_by("near-horizontal-edge:slope=0.0618", STRATIFIED, POINT), "Stairs, or a smooth ramp."),
        "jaggies_rms": Pair(
            *_by("near-horizontal-edge:slope=3.7", STRATIFIED, POINT),
            "On a steep edge it is the columns that cut it into stairs.",
        ),
        "jaggies_bias": Pair(
            *_by("near-horizontal-edge:slope=0,offset=0.0248", STRATIFIED, POINT),
            "The edge runs through the middle of a pixel row: half grey is true, black or white is half a pixel off.",
            side=40,
        ),
        "jaggies_str": Pair(
            *_by("near-horizontal-edge:slope=0.0618", "raytrace:sampler=random", POINT),
            "Both are ragged. Left it is noise, right it comes in regular steps.",
            seeds=4,
        ),
        "shimmer": Pair(
            *_by("checker-floor:speed=1", STRATIFIED, POINT),
            "Far squares are even grey on the left, and race and flash on the right.",
            frames=15,
        ),
        "shimmer_abs": Pair(
            *_by("confetti:count=800,size_px=5,speed=0.2", "raytrace:spp=16,filter=tent", POINT),
            "Triangles glide on the left, and jump and blink on the right.",
            frames=30,
        ),
        "buzz": Pair(
            *_by("near-horizontal-edge:slope=0.0618,speed=0.0234375", POINT, "raytrace:sampler=random"),
            "The edge rises slowly: its stairs crawl along on the left, its noise is new in every frame on the right.",
            frames=32,
        ),
        "flux_flicker": Pair(
            *_by("confetti:count=60,size_px=8,speed=0.4", STRATIFIED, POINT),
            "Right, triangles are there in one frame and gone in the next, and the light of the picture with them.",
            side=40,
            frames=15,
        ),
        "moire": Pair(
            *_by("window-screens:wires=82.5,speed=0", STRATIFIED, POINT),
            "Two screens truly beat, with the soft oblique bands on the left. The bars on the right are false.",
        ),
        "moire_peak": Pair(
            *_by("grid:lines=165,speed=0", STRATIFIED, POINT),
            "There are 33 lines to 16 pixels, an even grey. Right, one line in 16 pixels is all that is left of them.",
        ),
        "strobing": Pair(
            Shot("propeller:rev_per_s=29,shutter=1", "raytrace:spp=64"),
            Shot("propeller:rev_per_s=29", POINT),
            "29 turns a second: a blur with the shutter open for the whole frame, a slow backward turn at an instant.",
            frames=30,
            frame_ms=REAL_TIME_MS,
        ),
        "strobing_err": Pair(
            *_by("propeller:rev_per_s=29,shutter=1", STRATIFIED, "raytrace:spp=16,time=center"),
            "The shutter is open for the whole frame. Right, all samples are taken in the middle of it.",
            frames=30,
            frame_ms=REAL_TIME_MS,
        ),
        "apparent_rate": Pair(
            Shot("propeller:rev_per_s=29", STRATIFIED),
            Shot("propeller:rev_per_s=1", STRATIFIED),
            "Both turn forwards, counter-clockwise: the left one 29 times a second, the right one once.",
            frames=30,
            frame_ms=REAL_TIME_MS,
        ),
        "noise": Pair(
            *_by("soft-shadow", "raytrace:spp=64", "raytrace:sampler=random"),
            "The border of a soft shadow: smooth, or grain that is another one with every seed.",
            seeds=4,
        ),
        "structure": Pair(
            *_by("zone-plate:k=800", "raytrace:sampler=random", POINT),
            "Both have the same RMSE. Random samples make grain of it, samples at centres make false rings.",
            seeds=4,
        ),
        "bias": Pair(
            *_by("propeller:rev_per_s=8,shutter=1", STRATIFIED, "raytrace:spp=16,motion=matrix"),
            "Right, points move along chords, not arcs: blades shrink, and no number of samples brings the rim back.",
            seeds=8,
        ),
        "mtf50": Pair(
            *_by("near-horizontal-edge:slope=0.2764", WIDE, EXACT),
            "Both are exact, the left one with a filter many pixels wide.",
        ),
        "edge_width": Pair(
            *_by("near-horizontal-edge:slope=0.2764", EXACT, WIDE),
            "Both are exact, the right one with a filter many pixels wide.",
        ),
        "flip": Pair(
            *_by("brick-floor", "raytrace:spp=64", POINT),
            "Far bricks are an even tone on the left, and salt and pepper on the right.",
        ),
        "spatial": Pair(
            *_by("propeller:rev_per_s=2,shutter=0.5", STRATIFIED, POINT),
            "Whatever the motion, borders are smooth on the left and stairs on the right.",
            side=40,
            frames=15,
        ),
        "temporal": Pair(
            *_by("propeller:rev_per_s=2,shutter=1", STRATIFIED, "raytrace:spp=16,time=center"),
            "The shutter is open for the whole frame. Right, nothing of the blur is drawn.",
            side=40,
            frames=15,
        ),
        "shutter": Pair(
            Shot("propeller:rev_per_s=2,shutter=0.9", STRATIFIED),
            Shot("propeller:rev_per_s=2,shutter=0.1", STRATIFIED),
            "Blades flow into each other on the left, and are seen one by one on the right.",
            side=40,
            frames=15,
        ),
        "apparent_velocity": Pair(
            Shot("grid:lines=155,speed=2", POINT),
            Shot("grid:lines=11,speed=2", POINT),
            "Both move to the right. The left one is finer than the pixels: a false grid moves to the left.",
            frames=15,
        ),
        "gaps": Pair(
            *_by("slivers:count=32,narrowest_px=0.2,widest_px=2", "raytrace:spp=64", POINT),
            "Rays thinner than a pixel are whole on the left, and dots with gaps between them on the right.",
        ),
    }
)
