"""Cut-outs as geometry: an image's opaque texels become faces of their own, and every exact way works on them.

Where the true texture is made of squares, a surface with `alpha_cutoff` exists on the squares whose alpha reaches the
cutoff. The squares are merged into rectangles, repeated over the surface and clipped to its faces, on which the texture
map is affine: what remains is an ordinary surface without holes in it. Where all opaque texels have one colour it needs
no texture either, so a screen of wires is as exact, and as fast, as polygons.

A blend of texels is cut out where its blended alpha reaches the cutoff, along curves; that, and what has too many
rectangles, is sampled instead (`cutout_samples`).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aliasbench.renderers.reference.faces import Faces, build_faces
from aliasbench.renderers.reference.texel_rectangles import Lattice, build_lattice, cut_face, find_rectangles
from aliasbench.scenes.model import Camera, FloatArray, ImageTexture, Scene, Surface, Texture, read_only

MOST_PARTS = 200_000  # faces that all cut-outs of a scene may become


def opaque_texels(texture: ImageTexture) -> NDArray[np.bool_]:
    """Return where an image is not cut out, (h, w), compared in single precision as alpha is stored and drawn."""
    cutoff = np.float32(-np.inf if texture.alpha_cutoff is None else texture.alpha_cutoff)
    return texture.texels[..., 3] >= cutoff


def has_cutouts(scene: Scene) -> bool:
    """Return whether a surface of the scene has an image with an `alpha_cutoff`."""
    return any(_cut_image(scene, surface) is not None for surface in scene.objects)


def expand(scene: Scene, *, linear: bool) -> Scene | None:
    """Return the same scene with its cut-outs as geometry; the scene itself where it has none.

    Parameters
    ----------
    scene : Scene
    linear : bool
        Whether images are blends of their texels instead of squares.

    Returns
    -------
    Scene or None
        No texture in it has an `alpha_cutoff`. One surface may have become several, in its place in the order, or none.
        None where that needs more than `MOST_PARTS` faces, or curved borders: a blend with opaque and absent texels.
    """
    if not has_cutouts(scene):
        return scene
    lattices: dict[str, Lattice] = {}
    objects: list[Surface] = []
    left = MOST_PARTS
    for surface in scene.objects:
        image = _cut_image(scene, surface)
        if image is None or surface.texture is None:
            objects.append(surface)
            continue
        mask = opaque_texels(image)
        if not mask.any():
            continue
        plain = _plain(surface, image, mask)
        if mask.all():
            objects.append(plain)
            continue
        if linear:
            return None
        if surface.texture not in lattices:
            lattices[surface.texture] = build_lattice(mask)
        parts = _expand_surface(surface, plain, lattices[surface.texture], left)
        if parts is None:
            return None
        objects.extend(parts)
        left -= sum(len(p.triangles) for p in parts) // 2
    return replace(scene, objects=tuple(objects), textures=_without_cutoffs(scene))


def fill_holes(scene: Scene) -> Scene:
    """Return the scene as if nothing were cut out."""
    return replace(scene, textures=_without_cutoffs(scene))


def _without_cutoffs(scene: Scene) -> dict[str, Texture]:
    return {
        name: replace(t, alpha_cutoff=None) if isinstance(t, ImageTexture) else t for name, t in scene.textures.items()
    }


def _cut_image(scene: Scene, surface: Surface) -> ImageTexture | None:
    """Return a surface's texture if that is an image with a cutoff."""
    texture = None if surface.texture is None else scene.textures[surface.texture]
    return texture if isinstance(texture, ImageTexture) and texture.alpha_cutoff is not None else None


def _plain(surface: Surface, image: ImageTexture, mask: NDArray[np.bool_]) -> Surface:
    """Return the surface without its texture, if what is opaque of that has one colour."""
    colors = image.texels[..., :3][mask]
    if not (colors == colors[0]).all():
        return surface
    r, g, b = (c * float(t) for c, t in zip(surface.color, colors[0], strict=True))
    return replace(surface, color=(r, g, b), texture=None)


def _expand_surface(surface: Surface, plain: Surface, lattice: Lattice, most: int) -> list[Surface] | None:
    """Return what is opaque of a surface as surfaces; None where they would have more than `most` faces.

    Faces that share a plane and a texture map become one polygon, whose first vertices are theirs: plane and map are
    taken from these. Faces of a mesh without holes stay together.
    """
    faces = build_faces(Scene("", Camera("orthographic", height=1.0), (surface,)))
    whole: list[NDArray[np.int64]] = []
    out: list[Surface] = []
    for loops in _groups(faces):
        parts: list[FloatArray] = []
        for loop in loops:
            cut = _cut_loop(_corners(faces, loop, lattice), lattice, most - len(parts))
            if cut is None:
                return None
            parts.extend(cut)
        most -= len(parts)
        frame = np.arange(len(faces.vertices)) if surface.is_polygon and len(loops) > 1 else loops[0]
        if len(parts) == 1 and np.array_equal(parts[0], _corners(faces, loops[0], lattice)):
            if surface.is_polygon and len(loops[0]) == len(surface.vertices):
                return [plain]
            whole.append(loops[0])
        elif parts:
            out.append(_assemble(plain, _corners(faces, frame, lattice), parts, lattice))
    if whole:
        fans = [(loop[0], loop[i], loop[i + 1]) for loop in whole for i in range(1, len(loop) - 1)]
        # these triangles, not the outline of a polygon that has others
        out.insert(0, replace(plain, triangles=read_only(np.array(fans, np.int32)), is_polygon=False))
    return out


def _groups(faces: Faces) -> list[list[NDArray[np.int64]]]:
    """Return the faces' corners, those together that share a plane and a texture map."""
    groups: dict[tuple[int, ...], list[NDArray[np.int64]]] = {}
    for f, spread in enumerate(faces.spread.tolist()):
        groups.setdefault(tuple(spread), []).append(faces.corners[faces.starts[f] : faces.starts[f + 1]])
    return list(groups.values())


def _corners(faces: Faces, vertices: NDArray[np.int64], lattice: Lattice) -> FloatArray:
    """Return x, y, z and the texture coordinates in texels, (n, 5), of some vertices."""
    height, width = lattice.size
    return np.concatenate([faces.vertices[vertices], faces.uv[vertices] * (width, height)], axis=1)


def _cut_loop(corners: FloatArray, lattice: Lattice, most: int) -> list[FloatArray] | None:
    """Return the opaque parts of a convex face, corners (n, 5) each; None if they are more than `most`."""
    rectangles = find_rectangles(lattice, corners[:, 3:].min(axis=0), corners[:, 3:].max(axis=0))
    if rectangles is None:
        return None
    points, starts = cut_face(corners, rectangles, most)
    if len(starts) - 1 > most:
        return None
    return np.split(points, starts[1:-1]) if len(starts) > 1 else []


def _assemble(plain: Surface, frame: FloatArray, parts: list[FloatArray], lattice: Lattice) -> Surface:
    """Return one polygon whose triangles are those of convex parts, behind the vertices that give its plane."""
    points = np.concatenate([frame, *parts])
    first = np.cumsum([len(frame)] + [len(p) for p in parts[:-1]])
    fans = [(a, a + i, a + i + 1) for a, p in zip(first.tolist(), parts, strict=True) for i in range(1, len(p) - 1)]
    height, width = lattice.size
    return replace(
        plain,
        vertices=read_only(points[:, :3]),
        triangles=read_only(np.array(fans, np.int32)),
        is_polygon=True,
        uv=None if plain.texture is None else read_only(points[:, 3:] / (width, height)),
    )
