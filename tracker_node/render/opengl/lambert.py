"""pyrender's renderer with our light instead of its own: the shader programs, and the framebuffer that they draw into.

Import it after `renderer.import_pyrender` only. It builds on what pyrender calls private: its renderer walks the scene
and keeps the buffers on the GPU; programs, uniforms and framebuffer are replaced.

A vertex goes through the lens itself, so that pixels of a lens with distortion are sampled where they are. There is one sample
a pixel, at its center; the label travels in the alpha channel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from OpenGL import GL
from pyrender.camera import Camera
from pyrender.renderer import Renderer
from pyrender.shader_program import ShaderProgram, ShaderProgramCache

from ...camera.light import COS_INNER, COS_OUTER, DIRECTION, DIRECTIONAL, INTENSITY, KIND, N_LIGHT_COLUMNS, POINT, POSITION, SPOT
from ...camera.model import N_PARAMS

MAX_LIGHTS = 16  # what fits into the uniforms that every OpenGL has

_VERTEX = """
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 texcoord_0;
layout(location = 3) in vec4 color_0;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;
uniform float lens[%(n_params)d];  // as CameraModel.params

out vec3 place;
out vec3 direction;
out vec3 color;
out vec2 uv;
out float has_pixel;

vec2 distorted(vec2 p)
{
    float r2 = dot(p, p);
    if (lens[5] == 1.0) {
        float top = 1.0 + r2 * (lens[8] + r2 * (lens[9] + r2 * lens[12]));
        float bottom = 1.0 + r2 * (lens[13] + r2 * (lens[14] + r2 * lens[15]));
        float xy2 = 2.0 * p.x * p.y;
        vec2 shift = vec2(lens[10] * xy2 + lens[11] * (r2 + 2.0 * p.x * p.x), lens[10] * (r2 + 2.0 * p.y * p.y) + lens[11] * xy2);
        return p * (top / bottom) + shift;
    }
    if (lens[5] == 2.0) {
        float r = sqrt(r2);
        float a2 = atan(r) * atan(r);
        float bent = atan(r) * (1.0 + a2 * (lens[8] + a2 * (lens[9] + a2 * (lens[10] + a2 * lens[11]))));
        return r > 1e-6 ? p * (bent / r) : p;
    }
    return p;
}

void main()
{
    vec4 world = M * vec4(position, 1.0);
    vec3 seen = (V * world).xyz;
    has_pixel = 1.0;
    if (lens[5] != 0.0) {
        vec2 straight = seen.xy / seen.z;
        has_pixel = seen.z > 0.0 && dot(straight, straight) < lens[6] ? 1.0 : 0.0;
        if (has_pixel == 1.0)
            seen.xy = distorted(straight) * seen.z;
    }
    gl_Position = P * vec4(seen, 1.0);
    place = world.xyz;
    direction = mat3(M) * normal;
    color = color_0.rgb;
    uv = texcoord_0;
}
"""

_FRAGMENT = """
in vec3 place;
in vec3 direction;
in vec3 color;
in vec2 uv;
in float has_pixel;

uniform float label;
uniform vec3 gain;
uniform float power;
uniform int n_lights;
uniform float lights[%(n_light_values)d];
#if TEXTURED
uniform sampler2D picture;
#endif

out vec4 frag_color;

vec3 vector(int at) { return vec3(lights[at], lights[at + 1], lights[at + 2]); }

void main()
{
    if (has_pixel < 0.9999)  // at a corner of the triangle
        discard;
    vec3 n = normalize(gl_FrontFacing ? direction : -direction);
    vec3 sum = vec3(0.0);
    for (int i = 0; i < n_lights; ++i) {
        int at = %(n_columns)d * i;
        float kind = lights[at + %(kind)d];
        float share = 1.0;
        if (kind == %(directional)d.0)
            share = -dot(n, vector(at + %(direction)d));
        if (kind >= %(point)d.0) {
            vec3 to_light = normalize(vector(at + %(position)d) - place);
            share = dot(n, to_light);
            if (kind == %(spot)d.0) {
                float outer = lights[at + %(cos_outer)d];
                float inside = -dot(to_light, vector(at + %(direction)d)) - outer;
                share *= clamp(inside / (lights[at + %(cos_inner)d] - outer), 0.0, 1.0);
            }
        }
        sum += max(share, 0.0) * vector(at + %(intensity)d);
    }
#if TEXTURED
    vec3 surface = texture(picture, uv).rgb;
#else
    vec3 surface = color;
#endif
    frag_color = vec4(min(surface * pow(gain * sum, vec3(power)), 1.0), label);
}
"""

_VALUES = {
    "n_params": N_PARAMS, "n_light_values": MAX_LIGHTS * N_LIGHT_COLUMNS, "n_columns": N_LIGHT_COLUMNS,
    "kind": KIND, "intensity": INTENSITY, "position": POSITION, "direction": DIRECTION,
    "cos_outer": COS_OUTER, "cos_inner": COS_INNER, "directional": DIRECTIONAL, "point": POINT, "spot": SPOT,
}  # fmt: skip


class LensCamera(Camera):
    """A camera of pyrender with the projection matrix (4, 4) that it is given; the vertex shader adds the distortion."""

    def __init__(self, projection: np.ndarray, near: float, far: float):
        super().__init__(znear=near, zfar=far)
        self._projection = projection

    def get_projection_matrix(self, width: int | None = None, height: int | None = None) -> np.ndarray:
        """The matrix that was given.

        Parameters
        ----------
        width, height : not used; pyrender passes them.

        Returns
        -------
        (4, 4) clip coordinates from the camera's.
        """
        return self._projection


class _Program(ShaderProgram):
    def _load(self, source: str) -> str:
        return source  # pyrender's would read a file


class _Programs(ShaderProgramCache):
    """Two programs, with a texture and without; pyrender's choice of files is ignored."""

    def get_program(
        self, vertex_shader: str, fragment_shader: str, geometry_shader: str | None = None, defines: dict | None = None
    ) -> ShaderProgram:
        textured = "HAS_BASE_COLOR_TEX" in (defines or {})
        if textured not in self._program_cache:
            head = f"#version 330 core\n#define TEXTURED {int(textured)}\n"
            self._program_cache[textured] = _Program(head + _VERTEX % _VALUES, head + _FRAGMENT % _VALUES)
        return self._program_cache[textured]


class LambertRenderer(Renderer):
    """Draws a scene of pyrender under the law of `camera.light`, with labels in the alpha channel.

    Attributes
    ----------
    labels : node -> label, 1..255.
    lens : (`N_PARAMS`,) as ``CameraModel.params``.
    lights : (n, `N_LIGHT_COLUMNS`) of `pack_lights`, world frame.
    gain, gamma : of the camera.
    """

    _main_fb: Any
    _main_fb_dims: tuple[Any, Any]

    def __init__(self, viewport_width: int, viewport_height: int):
        super().__init__(viewport_width, viewport_height)
        self._program_cache = _Programs()
        self._lit: set[Any] = set()  # programs that know the values of this image
        self.labels: dict[Any, int] = {}
        self.lens, self.lights = np.zeros(N_PARAMS), np.zeros((0, N_LIGHT_COLUMNS))
        self.gain, self.gamma = (1.0, 1.0, 1.0), 1.0

    def _configure_forward_pass_viewport(self, flags: int) -> None:
        self._lit.clear()
        super()._configure_forward_pass_viewport(flags)
        GL.glEnable(GL.GL_SCISSOR_TEST)  # the framebuffer may be larger than what is drawn
        GL.glScissor(0, 0, self.viewport_width, self.viewport_height)

    def _bind_lighting(self, scene: Any, program: Any, node: Any, flags: int) -> None:
        program.set_uniform("label", self.labels[node] / 255.0)
        if program in self._lit:
            return
        self._lit.add(program)
        program.set_uniform("gain", np.asarray(self.gain, dtype=np.float64))
        program.set_uniform("power", 1.0 / self.gamma)
        program.set_uniform("n_lights", len(self.lights))
        for name, values in (("lights", self.lights), ("lens", self.lens)):
            place = GL.glGetUniformLocation(program._program_id, name)
            GL.glUniform1fv(place, values.size, np.ascontiguousarray(values, dtype=np.float32))

    def _bind_and_draw_primitive(self, primitive: Any, pose: np.ndarray, program: Any, flags: int) -> None:
        program.set_uniform("M", pose)
        primitive._bind()
        if primitive.material.baseColorTexture is not None:
            self._bind_texture(primitive.material.baseColorTexture, "picture", program)
        GL.glDisable(GL.GL_BLEND)
        (GL.glDisable if primitive.material.doubleSided else GL.glEnable)(GL.GL_CULL_FACE)
        GL.glDrawElements(GL.GL_TRIANGLES, primitive.indices.size, GL.GL_UNSIGNED_INT, None)
        primitive._unbind()

    def _configure_main_framebuffer(self) -> None:
        """One sample a pixel, and as large as the largest image so far, so that it is seldom made anew."""
        width, height = self._main_fb_dims
        if self._main_fb is not None and width >= self.viewport_width and height >= self.viewport_height:
            return
        size = max(width or 0, self.viewport_width), max(height or 0, self.viewport_height)
        self._delete_main_framebuffer()
        self._main_cb, self._main_db = GL.glGenRenderbuffers(2)
        self._main_fb = GL.glGenFramebuffers(1)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._main_fb)
        for buffer, kind, use in (
            (self._main_cb, GL.GL_RGBA8, GL.GL_COLOR_ATTACHMENT0),
            (self._main_db, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_ATTACHMENT),
        ):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, buffer)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, kind, *size)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, use, GL.GL_RENDERBUFFER, buffer)
        # Where pyrender expects several samples a pixel it finds the same buffers
        self._main_fb_ms, self._main_cb_ms, self._main_db_ms = self._main_fb, self._main_cb, self._main_db
        self._main_fb_dims = size

    def _read_main_framebuffer(self, scene: Any, flags: int) -> tuple[np.ndarray, np.ndarray]:
        """RGBA (h, w, 4) uint8 and depth (h, w) float32, meters along the optical axis; infinite where there is nothing."""
        width, height = self.viewport_width, self.viewport_height
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self._main_fb)
        color = GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE)
        depth = GL.glReadPixels(0, 0, width, height, GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT)
        color = np.frombuffer(color, dtype=np.uint8).reshape(height, width, 4)[::-1]
        depth = np.frombuffer(depth, dtype=np.float32).reshape(height, width)[::-1]
        camera = scene.main_camera_node.camera
        near, far = np.float32(camera.znear), np.float32(camera.zfar)
        meters = near * far / (far - depth * (far - near))
        return color, np.where(color[:, :, 3] > 0, meters, np.float32(np.inf))
