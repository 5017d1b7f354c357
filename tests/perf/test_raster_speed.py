"""What the rasterizer costs beside bare moderngl that issues the same draws, resolves and readbacks.

Textures are looked up by the same shader in both; what the driver's own choice of level would save is printed beside.

`make bench` measures, in rounds that take turns; otherwise every case runs once, small, and only pictures are checked.
The bare loops know nothing of scenes: one program with a matrix, one vertex buffer, float32 targets that are kept.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import moderngl
import numpy as np
import pytest

from aliasbench.renderers.catalog import prepare
from aliasbench.renderers.geometry import build_bodies
from aliasbench.renderers.raster.context import acquire_context
from aliasbench.renderers.raster.graphics import DEPTH32F, GraphicsContext
from aliasbench.renderers.raster.minification import make_shading
from aliasbench.renderers.raster.placement import make_placement
from aliasbench.renderers.raster.projection import Instant, Window, clip_matrices, depth_rule
from aliasbench.renderers.raster.shaders import scene_shader
from aliasbench.renderers.sampling.patterns import sample_set
from aliasbench.renderers.technique import parse_technique
from aliasbench.scenes.files import load_scene
from aliasbench.scenes.model import Scene
from aliasbench.scenes.textures import scene_chain

VERTEX = """#version 330 core
uniform mat4 matrix;
in vec3 position;
in vec3 color;
in vec2 texcoord;
flat out vec3 surface_color;
out vec2 coordinate;
out vec2 center_coordinate;
centroid out vec4 centroid_place;
void main() {
    gl_Position = matrix * vec4(position, 1.0);
    surface_color = color;
    coordinate = texcoord;
    center_coordinate = texcoord;
    centroid_place = vec4(texcoord, 1.0 + 0.0 * texcoord.x, gl_Position.w);
}
"""
FLAT = """#version 330 core
flat in vec3 surface_color;
out vec4 radiance;
void main() { radiance = vec4(surface_color, 1.0); }
"""
TEXTURED = """#version 330 core
flat in vec3 surface_color;
in vec2 coordinate;
uniform sampler2D image;
out vec4 radiance;
void main() { radiance = vec4(surface_color * texture(image, coordinate).rgb, 1.0); }
"""
MEAN = """#version 330 core
uniform sampler2D source;
out vec4 radiance;
void main() {
    ivec2 corner = 4 * ivec2(gl_FragCoord.xy);
    vec4 sum = vec4(0.0);
    for (int k = 0; k < 16; ++k) sum += texelFetch(source, corner + ivec2(k & 3, k >> 2), 0);
    radiance = sum / 16.0;
}
"""
SCREEN = """#version 330 core
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.5, 1.0); }
"""


class Bare:
    """One body of a scene, drawn without anything that a scene does not need."""

    def __init__(
        self,
        context: GraphicsContext,
        scene: Scene,
        size: tuple[int, int],
        samples: int,
        ssaa: int,
        *,
        levels_by_driver: bool = False,
    ) -> None:
        gl, self.scene, self.size, self.ssaa = context.gl, scene, size, ssaa
        self.made = ExitStack()
        self.context = context
        self.drawn = (size[0] * ssaa, size[1] * ssaa)
        (self.body,) = bodies = build_bodies(scene)
        self.placement = make_placement(bodies)
        names = {s.texture for s in scene.objects}
        self.image: Any = None
        (texture,) = names
        colors = np.zeros((len(self.body.vertices), 3), np.float32)
        for triangle, owner in zip(self.body.triangles, self.body.surfaces, strict=True):
            colors[triangle] = scene.objects[owner].color
        uv = self.body.uv
        if texture is not None:
            chain = scene_chain(scene, texture)
            uv = uv @ chain.uv_matrix[:, :2].T + chain.uv_matrix[:, 2]
            height, width = chain.levels[0].shape[:2]
            image = self.keep(gl.texture((width, height), 4, dtype="f4"))
            image.build_mipmaps(0, len(chain.levels) - 1)
            for k, level in enumerate(chain.levels):
                image.write(level, level=k)
            image.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
            self.image = image
        shader, uniforms = FLAT if texture is None else TEXTURED, {}
        if texture is not None and not levels_by_driver:
            chosen = parse_technique("raster:texture=trilinear")
            shading = make_shading(gl, scene, texture, chosen, context.max_texture_size)
            assert shading.image is not None
            self.image = self.keep(shading.image)
            shader, uniforms = scene_shader("scene.frag.glsl", shading), shading.uniforms
        self.program = self.keep(gl.program(vertex_shader=VERTEX, fragment_shader=shader))
        for name in set(uniforms) & set(self.program):
            self.program[name] = uniforms[name]
        vertices = np.concatenate([self.body.vertices, colors, uv], axis=1).astype(np.float32)
        buffer = self.keep(gl.buffer(vertices.tobytes()))
        names_used = [n for n in ("position", "color", "texcoord") if n in self.program]
        layout = "3f4 3f4 2f4" if "texcoord" in names_used else "3f4 3f4 8x"
        index = self.keep(gl.buffer(self.body.triangles.astype(np.int32).tobytes()))
        self.array = self.keep(gl.vertex_array(self.program, [(buffer, layout, *names_used)], index))
        made_with = 0 if samples == 1 else samples
        color = self.keep(gl.texture(self.drawn, 4, dtype="f4", samples=made_with))
        depth = self.keep(gl.depth_renderbuffer(self.drawn, samples=made_with))
        context.store(depth, self.drawn, samples, DEPTH32F)
        self.target = self.keep(gl.framebuffer([color], depth))
        self.plain = self.target
        if samples > 1 or ssaa > 1:
            self.plain = self.keep(gl.framebuffer([self.keep(gl.texture(size, 4, dtype="f4"))]))
        if ssaa > 1:
            self.mean = self.keep(
                gl.vertex_array(self.keep(gl.program(vertex_shader=SCREEN, fragment_shader=MEAN)), [])
            )
        self.color, self.samples = color, samples

    def keep(self, made: Any) -> Any:
        self.made.callback(made.release)
        return made

    def draw(self, jitter: tuple[float, float]) -> None:
        gl = self.context.gl
        instant = Instant(0, 0.0, jitter)
        (matrix,) = clip_matrices(
            self.scene, self.placement, instant, size=self.drawn, window=Window(0, 0, *self.drawn)
        )
        self.target.use()
        gl.enable_only(moderngl.DEPTH_TEST)
        rule = depth_rule(self.scene.camera)
        gl.depth_func = rule.comparison
        self.target.clear(*self.scene.background, 1.0, depth=rule.empty)
        if self.image is not None:
            self.image.use(0)
        self.program["matrix"].write(matrix.T.astype(np.float32).tobytes())
        self.array.render(moderngl.TRIANGLES)

    def picture(self, passes: int) -> np.ndarray:
        pixels = np.empty((self.size[1], self.size[0], 3), np.float32)
        total = np.zeros(pixels.shape) if passes > 1 else None
        for x, y, *_ in sample_set("jittered" if passes > 1 else "center", passes):
            self.draw((x - 0.5, y - 0.5))
            if self.samples > 1:
                self.context.resolve(self.target, self.plain)
            elif self.ssaa > 1:
                self.plain.use()
                self.context.gl.enable_only(moderngl.NOTHING)
                self.color.use(0)
                self.mean.render(moderngl.TRIANGLES, vertices=3)
            self.plain.read_into(pixels, components=3, dtype="f4")
            if total is not None:
                np.add(total, pixels, out=total)
        return pixels if total is None else (total / passes).astype(np.float32)


@pytest.fixture
def context() -> Iterator[GraphicsContext]:
    own = acquire_context()
    with own.use():
        yield own


def alternate(rounds: int, *functions: Callable[[], object]) -> list[float]:
    """Return the least milliseconds of each, taken in turns."""
    best = [np.inf] * len(functions)
    for _ in range(rounds):
        for k, function in enumerate(functions):
            start = time.perf_counter()
            function()
            best[k] = min(best[k], 1e3 * (time.perf_counter() - start))
    return best


@pytest.mark.parametrize(
    ("technique", "samples", "ssaa", "passes"),
    [
        ("raster:", 1, 1, 1),
        ("raster:msaa=4", 4, 1, 1),
        ("raster:ssaa=4", 1, 4, 1),
        ("raster:passes=16", 1, 1, 16),
        ("raster:texture=trilinear", 1, 1, 1),
    ],
)
def test_techniques_cost_little_more_than_bare_loops(
    benchmark: Any, context: GraphicsContext, technique: str, samples: int, ssaa: int, passes: int
) -> None:
    scene = load_scene("checker-floor" if "texture" in technique else "edge-fan")
    side, rounds = (512, 40) if benchmark.enabled else (32, 1)
    bare = Bare(context, scene, (side, side), samples, ssaa)
    plain = Bare(context, scene, (side, side), samples, ssaa, levels_by_driver=True)
    with bare.made, plain.made, prepare(scene, technique, size=(side, side)) as prepared:
        one, other, third = prepared.render().pixels, bare.picture(passes), plain.picture(passes)
        assert (np.abs(one - other).max(axis=2) > 1e-4).mean() < 0.02
        assert (np.abs(one - third).max(axis=2) > (0.1 if "texture" in technique else 2e-6)).mean() < 0.02
        pictures = (prepared.render, lambda: bare.picture(passes), lambda: plain.picture(passes))
        times = benchmark.pedantic(alternate, (rounds, *pictures), rounds=1)
        ratio = times[0] / times[1]
        if benchmark.enabled:
            by_driver = f"; levels by the driver {times[2]:.1f} ms" if "texture" in technique else ""
            print(f"\n{technique}: {times[0]:.1f} ms, bare {times[1]:.1f} ms: {ratio:.3f}{by_driver}")
            benchmark.extra_info["ratio"] = ratio
            assert ratio <= 1.1


def test_supersampling_costs_little_more_than_its_draw(benchmark: Any, context: GraphicsContext) -> None:
    scene = load_scene("edge-fan")
    side, rounds = (512, 25) if benchmark.enabled else (32, 1)
    bare = Bare(context, scene, (side, side), 1, 4)

    def draw() -> None:
        bare.draw((0.0, 0.0))
        context.gl.finish()

    with bare.made, prepare(scene, "raster:ssaa=4", size=(side, side)) as prepared:
        prepared.render()
        draw()
        times = benchmark.pedantic(alternate, (rounds, prepared.render, draw), rounds=1)
        if benchmark.enabled:
            print(f"\nssaa=4: {times[0]:.1f} ms, its draw {times[1]:.1f} ms: {times[0] / times[1]:.2f}")
            assert times[0] / times[1] <= 1.4
