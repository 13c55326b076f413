"""A capture that nothing of weft made: Blender's cloth solver moves a swatch, Cycles shows it under stripes.

  blender --background --python scripts/blender_capture.py -- OUT --preset Denim [OPTION ...]

writes the capture folder OUT (docs/formats.md) with the true surface and the source's constants in OUT/truth.
Needs Blender 3.4 with Cycles (Debian: blender, python3-numpy) and ffmpeg; 100 frames take 6 to 10 minutes of
processor time. Made for one swatch held by its two upper corners: at rest, or, with --frames beyond 3, the right
corner waving. A motion that is there (OUT/motion.npz) is not simulated again.

Blender's cloth is a lattice: springs k along the edges of its cells and k_d, in tension only, along their
diagonals; angular springs across edges. Its numbers depend on the cells and on its unit of time. Constants are
given and written per metre of cloth here, and converted (Lattice, below). A preset's numbers are taken to hold on
cells of 25 mm.

World: m, x to the camera's right, y away from it, z up. Images: px, x right, y down, the first pixel's centre at
(0.5, 0.5).
"""
import argparse
import dataclasses
import json
import math
import os
import re
import subprocess
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

GRAVITY = 9.81  # m/s^2
FRAME_RATE = 30.0  # 1/s; also Blender's unit of time for cloth
STEPS_PER_FRAME = 4  # frames of the simulation to one of the video
PRESET_CELL = 0.025  # m
SETTLING = 7.0  # s before frame 0
PIN_HEIGHT = 1.0  # m
WIDTH, HEIGHT = 640, 480  # px
PROJECTOR_SIZE = (1024, 768)  # px
BLACK_LEVEL = 0.05  # of the projector, of full scale
EXPOSURE = 0.62  # linear value of the 99th percentile of the cloth in frame 0
FULL_WELL, READ_NOISE = 9000.0, 10.0  # electrons


def parse_arguments(words):
    p = argparse.ArgumentParser(prog="blender_capture", description=__doc__.split("\n\n")[0])
    p.add_argument("out")
    p.add_argument("--preset", default="Cotton", help="of Blender: Cotton, Denim, Leather, Rubber, Silk")
    p.add_argument("--density", type=float, help="kg/m^2; of the preset")
    p.add_argument("--stretch", type=float, help="k of the edges, N/m; of the preset")
    p.add_argument("--diagonals", type=float, help="k_d of the diagonals, N/m; of the preset")
    p.add_argument("--bend", type=float, help="B, N m; of the preset")
    p.add_argument("--side", type=float, default=0.5, help="of the swatch, m")
    p.add_argument("--cells", type=int, default=40, help="of the lattice along a side")
    p.add_argument("--separation", type=float, help="of the held corners, m; three quarters of the side")
    p.add_argument("--frames", type=int, default=3, help="of the video; 3: at rest")
    p.add_argument("--amplitude", type=float, nargs=3, default=[0.0, 0.1, 0.0], help="of the right corner, m")
    p.add_argument("--frequency", type=float, nargs=3, default=[0.8, 0.8, 0.8], help="1/s")
    p.add_argument("--phase", type=float, nargs=3, default=[0.0, 0.0, 0.0], help="degrees")
    p.add_argument("--stripe-period", type=float, default=17.0, help="in the picture, px")
    p.add_argument("--seed", type=int, default=1, help="of the noise in the pictures")
    p.add_argument("--threads", type=int, default=os.cpu_count())
    a = p.parse_args(words)
    a.separation = a.separation or 0.75 * a.side
    a.waving = a.frames > 3
    for name in ("density", "stretch", "diagonals", "bend"):
        if getattr(a, name) is not None and not getattr(a, name) > 0:
            p.error(f"--{name} must be > 0")
    if not 0 < a.separation <= a.side:
        p.error(f"--separation must lie in (0, {a.side}]")
    if a.cells < 2 or a.frames < 3 or a.threads < 1:
        p.error("--cells must be >= 2, --frames >= 3, --threads >= 1")
    return a


# ------------------------------------------------------------------------------------------ constants


@dataclasses.dataclass
class Lattice:
    """Constants of the cloth as weft's files have them, and in Blender's numbers."""

    density: float  # kg/m^2
    stretch: float  # k, N/m
    diagonals: float  # k_d, N/m
    bend: float  # B, N m
    stretch_damping: float  # N s/m
    drag_rate: float  # 1/s
    bend_damping_number: float = 0.5  # Blender's own, a vertex: presets say none
    blender_mass: float = 0.3  # Blender's number a vertex; forces and drag are relative to it

    @staticmethod
    def of_preset(name):
        paths = [os.path.join(d, name + ".py") for d in bpy.utils.preset_paths("cloth")]
        paths = [path for path in paths if os.path.exists(path)]
        if not paths:
            sys.exit(f"blender_capture: Blender has no cloth preset {name}")
        with open(paths[0]) as file:
            text = file.read()
        number = {k: float(v) for k, v in re.findall(r"settings\.(\w+)\s*=\s*([-\d.eE]+)", text)}
        mass, tau = number["mass"], 1 / FRAME_RATE
        # Forces are in units of a vertex's real mass over Blender's, per squared unit of time.
        return Lattice(
            density=mass,
            stretch=number["tension_stiffness"] * PRESET_CELL / tau**2,
            diagonals=number["shear_stiffness"] * PRESET_CELL / tau**2,
            bend=0.05 * number["bending_stiffness"] * PRESET_CELL**4 / tau**2,
            stretch_damping=number["tension_damping"] * PRESET_CELL**2 / tau,
            drag_rate=0.01 * number["air_damping"] / mass / tau,
            blender_mass=mass,
        )

    def settings(self, cell):
        """Blender's settings for cells of this width, m."""
        tau = 1 / FRAME_RATE
        kilogram = self.density * cell**2 / self.blender_mass  # real ones to one of Blender's
        newton = kilogram / tau**2
        stretch, diagonals = self.stretch * cell / newton, self.diagonals * cell / newton
        damping = self.stretch_damping * tau / kilogram
        return {
            "mass": self.blender_mass,
            "tension_stiffness": stretch,
            "compression_stiffness": stretch,
            "shear_stiffness": diagonals,
            "bending_stiffness": self.bend / (0.05 * newton * cell**2),
            "tension_damping": damping,
            "compression_damping": damping,
            "shear_damping": damping,
            "bending_damping": self.bend_damping_number,
        }

    def damped_as_blender_can(self, cell):
        """Blender limits the damping of springs; fine cells reach that limit."""
        most = bpy.types.ClothSettings.bl_rna.properties["tension_damping"].hard_max
        wanted = self.settings(cell)["tension_damping"]
        if wanted <= most:
            return self
        damping = self.stretch_damping * most / wanted
        print(f"blender_capture: springs are damped by {damping:g} N s/m, Blender's most, not {self.stretch_damping:g}")
        return dataclasses.replace(self, stretch_damping=damping)

    def bend_damping(self, cell):
        """N m s."""
        return self.density / self.blender_mass * cell**4 * FRAME_RATE * self.bend_damping_number / 4

    def air_number(self):
        return self.drag_rate * self.blender_mass / 0.01 / FRAME_RATE


def constants_of(a):
    lattice = Lattice.of_preset(a.preset)
    given = {name: getattr(a, name) for name in ("density", "stretch", "diagonals", "bend")}
    lattice = dataclasses.replace(lattice, **{k: v for k, v in given.items() if v is not None})
    return lattice.damped_as_blender_can(a.side / a.cells)


# ------------------------------------------------------------------------------------------ motion


def smooth_step(t):
    """0 to 1 as t goes from 0 to 1, with two derivatives zero at both ends."""
    t = min(max(t, 0.0), 1.0)
    return t**3 * (10 + t * (-15 + 6 * t))


def corners_at(a, time):
    """Left and right corner, m. Before time 0 they close in from the flat swatch, one before the other."""
    t = min(max((time + SETTLING - 0.4) / 2.0, 0.0), 1.0)
    bump = 64 * (t * (1 - t)) ** 3
    reach = 0.5 * (a.side + (a.separation - a.side) * smooth_step(t))
    left = np.array([-reach, 0.06 * a.side * bump, PIN_HEIGHT])
    right = np.array([reach, -0.03 * a.side * bump, PIN_HEIGHT])
    if a.waving and time > 0:
        for i in range(3):
            angle = 2 * math.pi * a.frequency[i] * time + math.radians(a.phase[i])
            right[i] += smooth_step(time / 0.8) * a.amplitude[i] * math.sin(angle)
    return left, right


def swatch_mesh(a, name):
    n = a.cells
    across = np.linspace(-a.side / 2, a.side / 2, n + 1)
    points = [(x, 0.0, PIN_HEIGHT - a.side * j / n) for j in range(n + 1) for x in across]
    corner = [j * (n + 1) + i for j in range(n) for i in range(n)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], [(k, k + 1, k + n + 2, k + n + 1) for k in corner])
    layer = mesh.uv_layers.new(name="UVMap")
    for polygon in mesh.polygons:
        polygon.use_smooth = True
        for loop in polygon.loop_indices:
            row, column = divmod(mesh.loops[loop].vertex_index, n + 1)
            layer.data[loop].uv = (column / n, 1 - row / n)
    return mesh


def shown_points(obj):
    """Where its vertices are in this frame, modifiers applied: n x 3."""
    vertices = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices
    points = np.empty(3 * len(vertices), np.float32)
    vertices.foreach_get("co", points)
    return points.reshape(-1, 3)


def hold(scene, swatch, name, vertex, path):
    """A hook that moves the vertex along the path, one point a frame of the simulation from frame 1 on."""
    empty = bpy.data.objects.new(name, None)
    scene.collection.objects.link(empty)
    empty.location = path[0]
    action = bpy.data.actions.new(name)
    empty.animation_data_create().action = action
    for axis in range(3):
        curve = action.fcurves.new("location", index=axis)
        curve.keyframe_points.add(len(path))
        keys = np.empty(2 * len(path))
        keys[0::2], keys[1::2] = np.arange(1, len(path) + 1), path[:, axis]
        curve.keyframe_points.foreach_set("co", keys)
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
        curve.update()
    scene.frame_set(1)
    swatch.vertex_groups.new(name=name).add([vertex], 1.0, "REPLACE")
    hook = swatch.modifiers.new(name, "HOOK")
    hook.object, hook.vertex_group = empty, name
    hook.matrix_inverse = Matrix.Translation(Vector(path[0])).inverted()


def add_cloth(a, swatch, lattice, frame_0, last):
    modifier = swatch.modifiers.new("Cloth", "CLOTH")
    cloth = modifier.settings
    cloth.quality = 16
    cloth.time_scale = 1 / STEPS_PER_FRAME
    cloth.bending_model = "ANGULAR"
    cloth.vertex_group_mass, cloth.pin_stiffness = "pins", 1.0
    for key, value in lattice.settings(a.side / a.cells).items():
        setattr(cloth, key, value)
        if key.endswith("_stiffness"):  # as stiff at the end of a spring's range as at rest
            setattr(cloth, key + "_max", value)
        if abs(getattr(cloth, key) - value) > 1e-5 * max(1, value):
            sys.exit(f"blender_capture: Blender takes no {key} of {value:g}; other constants or --cells")
    modifier.collision_settings.use_collision = False
    modifier.point_cache.frame_start, modifier.point_cache.frame_end = 1, last
    # Thicker air until the swatch hangs still.
    air = lattice.air_number()
    thick = max(air, 2.5 * lattice.blender_mass * 100 / FRAME_RATE)
    step = FRAME_RATE * STEPS_PER_FRAME
    for frame, value in ((1, thick), (frame_0 - int(0.6 * step), thick), (frame_0 - int(0.3 * step), air)):
        cloth.air_damping = value
        cloth.keyframe_insert("air_damping", frame=frame)


def simulate(a, lattice):
    """Positions of the lattice's vertices in each frame of the video, frames x vertices x 3, m."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    moving = a.frames if a.waving else 1
    frame_0 = round(SETTLING * FRAME_RATE) * STEPS_PER_FRAME + 1
    last = frame_0 + (moving - 1) * STEPS_PER_FRAME + STEPS_PER_FRAME
    pull = GRAVITY / FRAME_RATE**2 / 0.001
    # A push along y while the corners close in: a flat sheet under compression is an unstable state.
    for time, push in ((0.0, 0.25), (0.6, 0.25), (1.2, 0.0), (1.3, 0.0)):
        scene.gravity = (0, push * pull, -pull)
        scene.keyframe_insert("gravity", frame=1 + time * FRAME_RATE * STEPS_PER_FRAME)
    scene.frame_start, scene.frame_end = 1, last + 1
    swatch = bpy.data.objects.new("swatch", swatch_mesh(a, "swatch"))
    scene.collection.objects.link(swatch)
    swatch.vertex_groups.new(name="pins").add([0, a.cells], 1.0, "REPLACE")
    times = (np.arange(last + 1) - (frame_0 - 1)) / (FRAME_RATE * STEPS_PER_FRAME)
    paths = np.array([corners_at(a, t) for t in times])
    hold(scene, swatch, "left", 0, paths[:, 0])
    hold(scene, swatch, "right", a.cells, paths[:, 1])
    add_cloth(a, swatch, lattice, frame_0, last + 1)
    positions = []
    for frame in range(1, last + 1):
        scene.frame_set(frame)
        x = shown_points(swatch)
        if not np.isfinite(x).all() or np.abs(x).max() > 10 * a.side + PIN_HEIGHT:
            sys.exit(f"blender_capture: the simulation left the scene at frame {frame}")
        if frame >= frame_0 and (frame - frame_0) % STEPS_PER_FRAME == 0 and len(positions) < moving:
            positions.append(x)
        if frame % 100 == 0:
            print(f"simulation {frame} of {last}", flush=True)
    return np.stack(positions)


# ------------------------------------------------------------------------------------------ optics


class Device:
    """A camera or a projector without distortion."""

    def __init__(self, position, target, focal_length, size):
        self.position, self.size, self.focal_length = np.array(position), size, focal_length
        forward = np.array(target) - self.position
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        self.from_world = np.stack([right, np.cross(forward, right), forward])
        k = np.array([[focal_length, 0, size[0] / 2], [0, focal_length, size[1] / 2], [0, 0, 1.0]])
        self.projection = k @ np.hstack([self.from_world, -(self.from_world @ self.position)[:, None]])

    def project(self, points):
        q = np.hstack([points, np.ones((len(points), 1))]) @ self.projection.T
        return q[:, :2] / q[:, 2:]

    def blender_matrix(self):
        """Blender's cameras and lights look along -z, y up."""
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([self.from_world[0], -self.from_world[1], -self.from_world[2]], axis=1)
        matrix[:3, 3] = self.position
        return Matrix(matrix.tolist())


def stripe_period(a, camera, projector):
    """Of the projector, px, for the wanted one in the picture at the middle of the flat swatch."""
    z = PIN_HEIGHT - 0.52 * a.side
    line = np.array([[0, 0, z], [0, 0, z - 0.01]])
    rows = [np.diff(device.project(line)[:, 1])[0] for device in (projector, camera)]
    return round(abs(rows[0] / rows[1]) * a.stripe_period, 3)


def math_node(tree, operation, *inputs, clamp=False):
    node = tree.nodes.new("ShaderNodeMath")
    node.operation, node.use_clamp = operation, clamp
    for slot, value in enumerate(inputs):
        if isinstance(value, (int, float)):
            node.inputs[slot].default_value = value
        else:
            tree.links.new(value, node.inputs[slot])
    return node.outputs[0]


def add_projector(scene, projector, period):
    """A point of light whose strength is the pattern in the direction of the ray."""
    light = bpy.data.lights.new("projector", "SPOT")
    lamp = bpy.data.objects.new("projector", light)
    scene.collection.objects.link(lamp)
    lamp.matrix_world = projector.blender_matrix()
    light.shadow_soft_size, light.spot_blend, light.energy = 0.0, 0.0, 320.0
    light.spot_size = 2.2 * math.atan(0.5 * math.hypot(*projector.size) / projector.focal_length)
    light.use_nodes = True
    tree = light.node_tree
    ray = tree.nodes.new("ShaderNodeNewGeometry").outputs["Incoming"]

    def along(axis):
        node = tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "DOT_PRODUCT"
        node.inputs[1].default_value = tuple(axis)
        tree.links.new(ray, node.inputs[0])
        return node.outputs["Value"]

    def pixel(axis):
        slope = math_node(tree, "DIVIDE", along(projector.from_world[axis]), along(projector.from_world[2]))
        scaled = math_node(tree, "MULTIPLY", slope, projector.focal_length)
        return math_node(tree, "ADD", scaled, projector.size[axis] / 2)

    column, row = pixel(0), pixel(1)
    wave = math_node(tree, "SINE", math_node(tree, "MULTIPLY", row, 2 * math.pi / period))
    bright = math_node(tree, "ADD", math_node(tree, "MULTIPLY", wave, 4.0), 0.5, clamp=True)
    strength = math_node(tree, "ADD", math_node(tree, "MULTIPLY", bright, 1 - BLACK_LEVEL), BLACK_LEVEL)
    for value, size in ((column, projector.size[0]), (row, projector.size[1])):
        for condition in (math_node(tree, "GREATER_THAN", value, 0.0), math_node(tree, "LESS_THAN", value, float(size))):
            strength = math_node(tree, "MULTIPLY", strength, condition)
    tree.links.new(strength, tree.nodes["Emission"].inputs["Strength"])


def weave(a, pixels=1024):
    """Uneven cloth: blotches, slubs along both threads, grain; mean 1."""
    random = np.random.default_rng(a.seed + 77)

    def band(along_u, along_v):  # noise smoothed over these lengths, m
        spectrum = np.fft.rfft2(random.normal(size=(pixels, pixels)))
        ku, kv = np.fft.rfftfreq(pixels, a.side / pixels), np.fft.fftfreq(pixels, a.side / pixels)
        spectrum *= np.exp(-2 * (np.pi * ku[None] * along_u) ** 2 - 2 * (np.pi * kv[:, None] * along_v) ** 2)
        noise = np.fft.irfft2(spectrum, (pixels, pixels))
        return noise / noise.std()

    return 0.5 * band(0.03, 0.03) + 0.4 * band(0.012, 0.0007) + 0.4 * band(0.0007, 0.012) + 0.6 * band(0.001, 0.001)


LOOKS = {  # colour, roughness, specular, sheen, how uneven
    "Silk": ((0.72, 0.66, 0.60), 0.42, 0.45, 0.2, 0.02),
    "Cotton": ((0.74, 0.74, 0.72), 0.90, 0.15, 0.35, 0.05),
    "Denim": ((0.38, 0.46, 0.60), 0.92, 0.12, 0.25, 0.12),
    "Leather": ((0.55, 0.42, 0.30), 0.55, 0.35, 0.0, 0.06),
    "Rubber": ((0.5, 0.5, 0.5), 0.6, 0.3, 0.0, 0.02),
}


def fabric_material(a):
    colour, roughness, specular, sheen, uneven = LOOKS.get(a.preset, LOOKS["Cotton"])
    material = bpy.data.materials.new("fabric")
    material.use_nodes = True
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    for key, value in (("Roughness", roughness), ("Specular", specular), ("Sheen", sheen)):
        shader.inputs[key].default_value = value
    texture = weave(a)
    image = bpy.data.images.new("weave", *texture.shape, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.ones((*texture.shape, 4), np.float32)
    pixels[..., :3] = np.array(colour) * np.clip(1 + 0.5 * uneven * texture, 0.3, 1.5)[..., None]
    image.pixels.foreach_set(pixels.ravel())
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.extension = image, "EXTEND"
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return material


def render_settings(a, scene):
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.use_denoising = "CPU", 16, False
    cycles.use_adaptive_sampling = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 1
    cycles.transmission_bounces = cycles.volume_bounces = 0
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 4
    cycles.filter_width = 1.5
    scene.render.threads_mode, scene.render.threads = "FIXED", a.threads
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "16"


def dim_room(scene):
    world = bpy.data.worlds.new("room")
    scene.world = world
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.9, 0.95, 1.0, 1)
    seen = world.node_tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
    strength = math_node(world.node_tree, "MULTIPLY_ADD", seen, 0.012 - 0.05, 0.05)  # darker to the camera
    world.node_tree.links.new(strength, background.inputs["Strength"])


def add_camera(scene, camera):
    data = bpy.data.cameras.new("camera")
    scene.camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(scene.camera)
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = camera.focal_length * data.sensor_width / WIDTH
    data.clip_start, data.clip_end = 0.05, 50
    scene.camera.matrix_world = camera.blender_matrix()


def linear_picture(scene, path):
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path)
    pixels = np.empty(WIDTH * HEIGHT * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    os.remove(path)
    return pixels.reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]


def seen_by_sensor(linear, gain, random):
    """8 bits, sRGB, with shot and read noise."""
    electrons = np.clip(linear * gain, 0, None) * FULL_WELL
    electrons = electrons + random.normal(size=electrons.shape) * np.sqrt(electrons + READ_NOISE**2)
    x = np.clip(electrons / FULL_WELL, 0, 1)
    return (255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055) + 0.5).astype(np.uint8)


def render(a, positions, camera, projector, period):
    """Writes the video. The surface that is shown at the lattice's vertices, frames x vertices x 3, m."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render_settings(a, scene)
    dim_room(scene)
    add_camera(scene, camera)
    add_projector(scene, projector, period)
    mesh = swatch_mesh(a, "cloth")
    cloth = bpy.data.objects.new("cloth", mesh)
    scene.collection.objects.link(cloth)
    mesh.materials.append(fabric_material(a))
    smooth = cloth.modifiers.new("smooth", "SUBSURF")  # its limit surface is what is shown
    smooth.levels = smooth.render_levels = 2
    smooth.boundary_smooth, smooth.use_limit_surface = "PRESERVE_CORNERS", True
    random, gain, shown = np.random.default_rng(a.seed), None, []
    with subprocess.Popen(
        ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{WIDTH}x{HEIGHT}"]
        + ["-framerate", f"{FRAME_RATE:g}", "-i", "-", "-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"]
        + [os.path.join(a.out, "video.mp4")],
        stdin=subprocess.PIPE,
    ) as encoder:
        for frame in range(a.frames):
            mesh.vertices.foreach_set("co", positions[min(frame, len(positions) - 1)].ravel())
            mesh.update()
            scene.cycles.seed = a.seed * 1000 + frame
            shown.append(shown_points(cloth)[: (a.cells + 1) ** 2].copy())
            linear = linear_picture(scene, os.path.join(a.out, "frame.exr"))
            if gain is None:
                bright = linear.max(axis=2)
                gain = EXPOSURE / np.percentile(bright[bright > 1.5 * bright[0, 0]], 99)  # of the cloth
            encoder.stdin.write(seen_by_sensor(linear, gain, random).tobytes())
            print(f"picture {frame + 1} of {a.frames}", flush=True)
    if encoder.returncode:
        sys.exit("blender_capture: ffmpeg failed")
    return np.stack(shown)


# ------------------------------------------------------------------------------------------ files


def matrix_text(matrix):
    return "[\n" + ",\n".join("  [" + ", ".join(repr(float(v)) for v in row) + "]" for row in matrix) + "\n]"


def write_capture(a, lattice, camera, projector, period):
    name = os.path.basename(os.path.normpath(a.out))
    corners = "\n".join(
        f'''
[[fixture]]
name = "{side} corner"
kind = "point"
at = [{u}, 0.0]
motion = "corners.csv"
columns = ["{side}_x_m", "{side}_y_m", "{side}_z_m"]'''
        for side, u in (("left", 0.0), ("right", a.side))
    )
    text = f'''format = "weft-capture"
version = 1
kind = "video"
name = "{name}"
description = "a square swatch held by its two upper corners; moved by Blender's cloth solver, rendered by Cycles with sensor noise"

[swatch]
width = {a.side}   # m
height = {a.side}  # m
areal_density = {lattice.density}  # kg/m^2

[world]
gravity = [0.0, 0.0, -{GRAVITY}]  # m/s^2

[video]
file = "video.mp4"
frame_rate = {FRAME_RATE}  # 1/s
frame_count = {a.frames}
fit_frames = [0, {min(a.frames, 50) - 1}]  # the others are held back
start = "at-rest"

[camera]
width = {WIDTH}
height = {HEIGHT}
projection = {matrix_text(camera.projection)}

[projector]
projection = {matrix_text(projector.projection)}
pattern = "square"
stripe_period = {period}
{corners}

[truth]
rest_mesh = "truth/rest.obj"
points = "truth/points.pc2"
'''
    with open(os.path.join(a.out, "capture.toml"), "w") as file:
        file.write(text)
    with open(os.path.join(a.out, "corners.csv"), "w") as file:
        file.write("time_s,left_x_m,left_y_m,left_z_m,right_x_m,right_y_m,right_z_m\n")
        for frame in range(a.frames):
            left, right = corners_at(a, frame / FRAME_RATE)
            numbers = (frame / FRAME_RATE, *left, *right)
            file.write(",".join(f"{v:.9f}" for v in numbers) + "\n")


def write_truth(a, lattice, shown):
    folder, n = os.path.join(a.out, "truth"), a.cells
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, "points.pc2"), "wb") as file:
        file.write(b"POINTCACHE2\0" + np.array([1, shown.shape[1]], "<i4").tobytes())
        file.write(np.array([0, 1], "<f4").tobytes() + np.array([len(shown)], "<i4").tobytes())
        file.write(shown.astype("<f4").tobytes())
    with open(os.path.join(folder, "rest.obj"), "w") as file:
        file.write("# the surface's grid at rest; vt = (u, v) on the undeformed swatch, m\n")
        for k in range((n + 1) ** 2):
            u, v = (k % (n + 1)) * a.side / n, (k // (n + 1)) * a.side / n
            file.write(f"v {u:.6f} 0 {-v:.6f}\nvt {u:.6f} {v:.6f}\n")
        for k in (j * (n + 1) + i + 1 for j in range(n) for i in range(n)):
            for triangle in ((k, k + 1, k + n + 2), (k, k + n + 2, k + n + 1)):
                file.write("f " + " ".join(f"{v}/{v}" for v in triangle) + "\n")
    write_fabric(a, lattice)
    values = {
        "note": "of a lattice: springs k along the edges of its cells, k_d in tension only along their diagonals; only "
        "ratios to the areal density are fixed by the motion",
        "areal_density_kg_m2": lattice.density,
        "bending_stiffness_N_m": lattice.bend,
        "edge_spring_k_N_per_m": lattice.stretch,
        "edge_spring_compression_k_N_per_m": lattice.stretch,
        "diagonal_spring_k_d_N_per_m": lattice.diagonals,
        "tension_damping_N_s_per_m": lattice.stretch_damping,
        "bending_damping_N_m_s": lattice.bend_damping(a.side / n),
        "air_drag_rate_per_s": lattice.drag_rate,
        "air_drag_kg_per_m2_s": lattice.drag_rate * lattice.density,
    }
    with open(os.path.join(folder, "parameters.toml"), "w") as file:
        file.write("# what the source's solver ran with, per metre of cloth; another model than weft's own\n")
        file.writelines(f"{key} = {json.dumps(value)}\n" for key, value in values.items())


def write_fabric(a, lattice):
    """The source's constants in the model of weft that comes nearest: threads, diagonals that act in tension only and
    carry half of their force along each thread, bends at the edges of the cells, a twist 4/3 as stiff."""
    drag, damping = lattice.drag_rate * lattice.density, max(lattice.stretch_damping, 0.001)  # silk's is 0
    values = {
        "stretch_stiffness": (lattice.stretch, "N/m", 5, 5000),
        "shear_stiffness": (0.01, "N/m", 0.01, 5000),
        "diagonal_stiffness": (2 * lattice.diagonals, "N/m", 1, 5000),
        "bend_stiffness": (lattice.bend, "N m", 1e-7, 0.01),
        "twist_stiffness": (4 / 3 * lattice.bend, "N m", 1e-7, 0.01),
        "stretch_damping": (damping, "N s/m", 0.001, 20),
        "shear_damping": (0.001, "N s/m", 0.001, 20),
        "diagonal_damping": (2 * damping, "N s/m", 0.001, 20),
        "bend_damping": (lattice.bend_damping(a.side / a.cells), "N m s", 1e-9, 1e-5),
        "drag_linear": (drag, "N s/m^3", 0, 10),
        "drag_normal_linear": (drag, "N s/m^3", 0, 10),
        "drag_quadratic": (0, "N s^2/m^4", 0, 10),
        "drag_degradation": (0, "s^2/m^2", 0, 10),
    }
    with open(os.path.join(a.out, "truth", "fabric.toml"), "w") as file:
        file.write(f'''format = "weft-fabric"
version = 1
name = "{a.preset.lower()}-source"
model = "baraff-witkin-hinges"
areal_density = {lattice.density}  # kg/m^2
provenance = "constants of the solver that moved this capture, by scripts/blender_capture.py"

[parameters]
''')
        for key, (value, unit, lower, upper) in values.items():
            lower, upper = min(lower, value), max(upper, value)
            file.write(f'{key} = {{ value = {value:.6g}, unit = "{unit}", lower = {lower:g}, upper = {upper:g} }}\n')


def motion_of(a, lattice):
    path = os.path.join(a.out, "motion.npz")
    made_with = json.dumps([dataclasses.asdict(lattice), a.side, a.cells, a.separation, a.waving]
                           + [a.amplitude, a.frequency, a.phase])
    if os.path.exists(path):
        with np.load(path) as stored:
            if str(stored["made_with"]) != made_with:
                sys.exit(f"blender_capture: {path} was made with other options; remove it")
            if not a.waving or len(stored["positions"]) >= a.frames:
                return stored["positions"][: a.frames]
    positions = simulate(a, lattice)
    np.savez_compressed(path, positions=positions, made_with=made_with)
    return positions


def check_in_view(positions, camera, projector):
    for name, device in (("camera", camera), ("projector", projector)):
        q = device.project(positions.reshape(-1, 3))
        if not ((q >= 0) & (q <= device.size)).all():
            print(f"blender_capture: warning: the swatch leaves the {name}'s field of view", file=sys.stderr)


def main():
    a = parse_arguments(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    os.makedirs(a.out, exist_ok=True)
    lattice = constants_of(a)
    camera = Device((0.04, -1.5, 0.8), (0, 0, 0.73), 900.0, (WIDTH, HEIGHT))
    projector = Device((-0.1, -1.45, 1.12), (0, 0, 0.73), 1250.0, PROJECTOR_SIZE)
    positions = motion_of(a, lattice)
    check_in_view(positions, camera, projector)
    period = stripe_period(a, camera, projector)
    shown = render(a, positions, camera, projector, period)
    write_truth(a, lattice, shown)
    write_capture(a, lattice, camera, projector, period)
    print(f"wrote {a.out}")


if __name__ == "__main__":
    main()
