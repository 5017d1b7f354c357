"""Scene files on the command line: writing one to start from, and checking what people wrote.

What is wrong with a file comes from `scenes.checking`; here it meets what the renderers can do with it.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from aliasbench.bench.whole_files import make_folder, write_files
from aliasbench.scenes.checking import Checked, check_scene_file
from aliasbench.scenes.errors import InputError, UnsupportedScene
from aliasbench.scenes.export import export_scene
from aliasbench.scenes.files import NO_MEMORY, load_scene
from aliasbench.scenes.model import TEXTURE_KINDS, Animation, ImageTexture, Scene, Texture
from aliasbench.scenes.toml_text import safe_file_name

PROBE_SIZE = (16, 16)  # pixels: enough to be told whether a scene can be drawn
RENDERERS = ("raytrace", "raster", "reference")


def export_text(name: str) -> str:
    """Return a scene, of the catalog or of a file, as one scene file with everything in it."""
    return export_scene(load_scene(name)).text


def export_files(name: str, out: Path) -> list[Path]:
    """Write a scene as a scene file, its images beside it, and return the paths, the scene file's first.

    Parameters
    ----------
    name : str
        Of the catalog, or a file's path.
    out : Path
        A folder, created where it is missing, or the scene file's path, ending in ``.toml``.

    Raises
    ------
    InputError
        If the scene is none, or anything cannot be written; then nothing was.
    """
    scene = load_scene(name)
    folder, stem = (out.parent, out.stem) if out.suffix.lower() == ".toml" else (out, safe_file_name(scene.name))
    exported = export_scene(scene, beside=safe_file_name(stem))
    make_folder(folder)
    # The scene file last: what it names is there before it is.
    *images, written = write_files(folder, {**exported.images, f"{stem}.toml": exported.text.encode("utf-8")})
    return [written, *images]


def supported_by(scene: Scene) -> dict[str, str | None]:
    """Return for each renderer None where it can draw a scene, or the reason why not."""
    from aliasbench.renderers import catalog

    found: dict[str, str | None] = {}
    for renderer in RENDERERS:
        try:
            with catalog.prepare(scene, f"{renderer}:", size=PROBE_SIZE):
                found[renderer] = None
        except (UnsupportedScene, InputError) as error:
            found[renderer] = str(error)
        except MemoryError:
            found[renderer] = NO_MEMORY
    return found


@dataclass(frozen=True, slots=True)
class Summary:
    """What a scene has, and which renderers can draw it (None, or the reason why not)."""

    scene: str
    objects: int
    triangles: int
    textures: Mapping[str, str]
    lights: int
    animation: Animation
    still: bool
    facts: Mapping[str, int]
    renderers: Mapping[str, str | None]


def summarise(scene: Scene) -> Summary:
    """Return what there is to say of a scene that is sound."""
    known = scene.facts
    facts = {"edge": known.edges, "rotor": known.rotors, "grating": known.gratings, "pan": known.pans}
    return Summary(
        scene=scene.name,
        objects=len(scene.objects),
        triangles=sum(len(surface.triangles) for surface in scene.objects),
        textures={name: _kind_of(texture) for name, texture in scene.textures.items()},
        lights=len(scene.lights),
        animation=scene.animation,
        still=scene.is_static,
        facts={kind: len(found) for kind, found in facts.items() if found},
        renderers=supported_by(scene),
    )


def check_files(paths: Sequence[Path]) -> tuple[list[Checked], list[str]]:
    """Return what checking each file gave, and a sentence for each that cannot even be read."""
    checked, unreadable = [], []
    for path in paths:
        try:
            checked.append(check_scene_file(path))
        except InputError as error:
            unreadable.append(str(error))
    return checked, unreadable


def checked_row(checked: Checked) -> dict[str, object]:
    """Return what checking a file gave as plain data: its problems, or what the scene has and who can draw it."""
    row: dict[str, object] = {
        "file": checked.file,
        "ok": checked.scene is not None,
        "problems": [{"line": f.line, "key": f.key, "message": f.text} for f in checked.findings],
    }
    return row if checked.scene is None else row | asdict(summarise(checked.scene))


def checked_lines(checked: Checked) -> list[str]:
    """Return the same as lines for people: one for each problem, or one that begins with ok."""
    if checked.scene is None:
        return [f"{checked.file}:{f.line or 1}: {f.text}" for f in checked.findings]
    summary = summarise(checked.scene)
    moving = summary.animation
    kinds = Counter(summary.textures.values())
    parts = [
        _counted_objects(summary),
        ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "no texture",
        *([_counted(summary.lights, "light")] if summary.lights else []),
        "still" if summary.still else f"{_counted(moving.frames, 'frame')} at {moving.fps:g} fps",
        *([f"shutter {moving.shutter:g}"] if moving.shutter else []),
        "facts: " + (", ".join(f"{count} {kind}" for kind, count in summary.facts.items()) or "none"),
    ]
    able = [name for name, why in summary.renderers.items() if why is None]
    lines = [f"ok: {checked.file}: {summary.scene}: {'; '.join(parts)}; drawn by {', '.join(able) or 'none'}"]
    return lines + [f"    not by {name}: {why}" for name, why in summary.renderers.items() if why is not None]


def _counted_objects(summary: Summary) -> str:
    if not summary.objects:
        return "no objects"
    return f"{_counted(summary.objects, 'object')} of {_counted(summary.triangles, 'triangle')}"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' if count != 1 else ''}"


def _kind_of(texture: Texture) -> str:
    kind = TEXTURE_KINDS[type(texture)]
    if isinstance(texture, ImageTexture):
        height, width = texture.texels.shape[:2]
        return f"{kind} {width} x {height}{' with cut-outs' if texture.alpha_cutoff is not None else ''}"
    return kind.replace("_", " ")
