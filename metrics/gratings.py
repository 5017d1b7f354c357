"""What a scene says of its gratings: their frequencies, how a pan moves them, and how strong their harmonics are.

A declared grating is a frequency vector; its profile is that of the texture which has this frequency, as it is in the
scene: sharp, before any pixel filter or shutter. So the share of it that a picture still shows is known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aliasbench.metrics.gate import LUMINANCE, Signals
from aliasbench.metrics.shimmer import pan_px_per_frame
from aliasbench.metrics.spectrum import known_frequencies
from aliasbench.scenes.model import FloatArray, Grating, GratingFact, ImageTexture, PanFact, Scene, Surface

# Harmonics of a profile that are counted; those of a square wave beyond have 1e-4 of its power.
HARMONICS = 4096
CLOSE = 1e-6
NO_MOTION = 1e-9  # cycles a frame: a grating that slides along itself, but for rounding


@dataclass(frozen=True, slots=True, eq=False)
class MovingGrating:
    """A grating that a pan moves, in the picture.

    Attributes
    ----------
    frequency : (float, float)
        (x, y) in cycles per pixel, y down.
    cycles_per_frame : float
        That move past a fixed point from one frame to the next; above 0 the way of the frequency vector.
    amplitudes : (HARMONICS,) float64 or None
        |a_k| of the sharp profile sum_k a_k exp(2 pi i k f x), k = 1, 2, ..., in units of the contrast (a sine of
        amplitude A has A / 2); None where the scene does not say.
    """

    frequency: tuple[float, float]
    cycles_per_frame: float
    amplitudes: FloatArray | None

    def is_aliased(self, k: NDArray[np.number]) -> NDArray[np.bool_]:
        """Return whether harmonics move half a cycle a frame or more."""
        out: NDArray[np.bool_] = 2.0 * np.abs(k * self.cycles_per_frame) >= 1.0 - NO_MOTION
        return out

    @property
    def length(self) -> float:
        """Cycles per pixel along the frequency vector."""
        return float(np.hypot(*self.frequency))


def moving_gratings(signals: Signals) -> list[MovingGrating]:
    """Return the declared gratings as the first declared pan moves them; none where a picture has no one frequency.

    That is, under perspective, on a plane seen edge-on and before a camera that turns.
    """
    scene = signals.scene
    facts, camera = scene.facts, scene.camera
    turns = camera.target_velocity is not None and camera.target_velocity != camera.velocity
    frequencies = known_frequencies(signals)
    if not facts.pans or turns or len(frequencies) != len(facts.gratings):
        return []
    x, y = pan_px_per_frame(facts.pans[0], signals)
    way = way_of_picture(facts.pans[0], scene)
    out = []
    for (nx, ny), fact in zip(frequencies, facts.gratings, strict=True):
        cycles = way * (nx * x + ny * y)
        out.append(MovingGrating((nx, ny), cycles if abs(cycles) > NO_MOTION else 0.0, sharp_amplitudes(scene, fact)))
    return out


def way_of_picture(pan: PanFact, scene: Scene) -> float:
    """Return 1 where the picture moves as the pan says, -1 where the pan is named after the camera.

    Scene files may name it either way; which, the objects tell.
    """
    velocity = np.array(pan.velocity)
    moving = [surface.motion.velocity for surface in scene.objects] or [(0.0, 0.0, 0.0)]
    seen = [np.subtract(own, scene.camera.velocity) for own in moving]
    close = CLOSE * float(np.linalg.norm(velocity))
    with_it = any(np.linalg.norm(v - velocity) <= close for v in seen)
    against = any(np.linalg.norm(v + velocity) <= close for v in seen)
    return -1.0 if against and not with_it else 1.0


def sharp_amplitudes(scene: Scene, fact: GratingFact) -> FloatArray | None:
    """Return |a_k| of a declared grating's harmonics (see `MovingGrating`), from the first texture that has it.

    A scene without objects is known by its facts alone: its grating is taken for a sine from black to white.
    """
    if not scene.objects:
        return _profile("sine", 1.0)
    for surface in scene.objects:
        found = _amplitudes_on(surface, scene, np.array(fact.cycles_per_unit))
        if found is not None and found.any():
            return found / scene.contrast
    return None


def _amplitudes_on(surface: Surface, scene: Scene, frequency: FloatArray) -> FloatArray | None:
    """Return |a_k| of a frequency (x, y) in cycles per world unit on a surface, in radiance; None if it has no such."""
    if surface.texture is None or surface.uv is None or not len(surface.triangles):
        return None
    corners, uv = surface.vertices[surface.triangles[0], :2], surface.uv[surface.triangles[0]]
    edges = np.asarray(corners[1:] - corners[0], dtype=np.float64)
    if abs(np.linalg.det(edges)) < 1e-12 * float(np.sum(edges**2)):
        return None
    # Row by row the change of u and of v per world unit.
    gradients = np.linalg.solve(edges, np.asarray(uv[1:] - uv[0], dtype=np.float64)).T
    tint = np.array(LUMINANCE) * surface.color
    texture = scene.textures[surface.texture]
    if isinstance(texture, Grating):
        angle = np.radians(texture.angle_deg)
        own = texture.cycles * (np.array([np.cos(angle), np.sin(angle)]) @ gradients)
        if min(np.abs(own - frequency).max(), np.abs(own + frequency).max()) > CLOSE * np.abs(own).max():
            return None
        return _profile(texture.profile, abs(float(tint @ np.subtract(texture.high, texture.low))))
    if isinstance(texture, ImageTexture) and texture.alpha_cutoff is None:
        if abs(np.linalg.det(gradients)) < 1e-12 * float(np.sum(gradients**2)):
            return None
        periods = np.linalg.solve(gradients.T, frequency)
        p, q = np.round(periods)
        if np.abs(periods - (p, q)).max() > CLOSE * max(1.0, np.abs(periods).max()):
            return None
        return _texel_amplitudes(texture, tint, int(p), int(q))
    return None


def _profile(profile: str, swing: float) -> FloatArray:
    """Return |a_k| of a wave between two values `swing` apart; those of a square wave are swing |sinc(k / 2)| / 2."""
    k = np.arange(1, HARMONICS + 1)
    out: FloatArray = np.abs(np.sinc(k / 2)) / 2.0 if profile == "square" else np.where(k == 1, 0.25, 0.0)
    return swing * out


def _texel_amplitudes(texture: ImageTexture, tint: FloatArray, p: int, q: int) -> FloatArray:
    """Return |a_k| of k (p, q) periods per unit of (u, v): the texels' transform times that of a texel."""
    k = np.arange(1, HARMONICS + 1)
    grey = texture.texels[..., :3].astype(np.float64) @ tint
    height, width = grey.shape
    spectrum = np.fft.fft2(grey) / grey.size
    out: FloatArray = np.abs(spectrum[k * q % height, k * p % width] * np.sinc(k * p / width) * np.sinc(k * q / height))
    return out
