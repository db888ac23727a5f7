"""Draw the pictures of the documentation with `python docs/render.py [FOLDER]`.

Every picture is a run of the library, drawn off screen by MuJoCo; on a machine without a display set MUJOCO_GL=egl.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.image
import mujoco
import numpy as np
import render_ground
import render_walk

from wbc.core.errors import Array
from wbc.robots import load
from wbc.sim.balance import StandSpec, StandTrial
from wbc.sim.balance.push_recovery import PUSH_DURATION

SIZE = (1600, 560)
"""Width and height of a picture, pixels."""

FORCE_SCALE = 3e-3
"""Length of a force arrow, m/N."""

SPACING = 1.0
"""Distance between the robots of a picture, m."""

IMPULSE = 0.28
"""Of the push, forward, Ns/kg."""

TIMES = (-0.05, 0.08, 0.3, 0.7, 3.0)
"""Instants that are drawn, from the beginning of the push, s."""

SKY = (0.93, 0.95, 0.97)
GROUND_FORCE, PUSH_FORCE = (0.10, 0.62, 0.30, 1.0), (0.85, 0.15, 0.15, 1.0)


@dataclass(frozen=True)
class Frame:
    """One instant of a run.

    Attributes:
        qpos: MuJoCo's configuration of the drawn robot.
        arrows: Foot, force (m, N in the world) and colour of each arrow.
    """

    qpos: Array
    arrows: tuple[tuple[Array, Array, tuple[float, ...]], ...]


def push_frames(robot: str) -> list[Frame]:
    """A robot that is pushed and recovers."""
    trial = StandTrial(StandSpec(robot=robot, mode="torque"))
    plant = trial.plant
    begin, force = 0.5, IMPULSE * plant.robot.mass / PUSH_DURATION
    torso = plant.robot.torso_frame
    frames: list[Frame] = []
    pushed = False
    model = drawn_model(robot, 1)
    names = plant.robot.joint_names
    for time in TIMES:
        if time > 0.0 and not pushed:
            list(trial.advance(begin))
            plant.push("torso", [force, 0.0, 0.0], PUSH_DURATION)
            pushed = True
        *_, truth = trial.advance(begin + time)
        qpos = np.zeros(model.nq)
        qpos[:3], qpos[3:7] = truth.q[:3], truth.q[[6, 3, 4, 5]]
        for name, angle in zip(names, truth.q[7:], strict=True):
            qpos[model.joint(f"0/{name}").qposadr[0]] = angle
        arrows = []
        for i in range(len(plant.robot.soles)):
            mine = truth.contact_sole == i
            total = truth.contact_force[mine].sum(axis=0)
            if total[2] > 1.0:
                weight = truth.contact_force[mine, 2] / total[2]
                arrows.append((weight @ truth.contact_position[mine], total, GROUND_FORCE))
        if 0.0 < time < PUSH_DURATION:
            plant.robot.update(truth.q, truth.v)
            place = np.array(plant.robot.placement(torso).translation) + [0.0, 0.0, 0.15]
            arrows.append((place - [force * FORCE_SCALE + 0.12, 0, 0], np.array([force, 0, 0]), PUSH_FORCE))
        frames.append(Frame(qpos, tuple(arrows)))
    if trial.fallen:
        raise RuntimeError("the robot of the picture has fallen")
    return frames


def drawn_model(robot: str, copies: int) -> mujoco.MjModel:
    """Robots as they look, side by side on a floor."""
    spec = mujoco.MjSpec()
    spec.visual.global_.offwidth, spec.visual.global_.offheight = SIZE
    spec.visual.global_.fovy = 13.0
    spec.visual.map.fogstart, spec.visual.map.fogend = 4.0, 9.0
    spec.visual.rgba.fog = [*SKY, 1.0]
    spec.visual.headlight.ambient = [0.45] * 3
    spec.visual.headlight.diffuse = [0.35] * 3
    spec.visual.quality.shadowsize = 4096
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=SKY, rgb2=SKY, width=64, height=64,
    )  # fmt: skip
    spec.add_texture(
        name="grid", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.80, 0.82, 0.84], rgb2=[0.87, 0.89, 0.91], width=512, height=512,
    )  # fmt: skip
    grid = spec.add_material(name="grid", texrepeat=[4, 4], texuniform=True)
    grid.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "grid"
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], material="grid")
    spec.worldbody.add_light(
        pos=[1.7, -4.0, 8.0],
        dir=[0.0, 0.5, -1.0],
        diffuse=[0.45] * 3,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        castshadow=True,
    )
    description = load(robot)
    for i in range(copies):
        one = mujoco.MjSpec.from_string(description.urdf)
        one.compiler.discardvisual = False
        one.worldbody.first_body().add_freejoint(name="root_joint")
        mount = spec.worldbody.add_frame(pos=[i * SPACING, 0.0, 0.0])
        spec.attach(one, prefix=f"{i}/", frame=mount)
    return spec.compile()


def draw(robot: str, frames: Sequence[Frame], path: Path) -> None:
    """Draw the instants side by side, the first one to the left."""
    model = drawn_model(robot, len(frames))
    data = mujoco.MjData(model)
    for i, frame in enumerate(frames):
        start = i * frame.qpos.size
        data.qpos[start : start + frame.qpos.size] = frame.qpos
        data.qpos[start] += i * SPACING
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat = [0.5 * (len(frames) - 1) * SPACING, 0.0, 0.72]
    camera.distance, camera.azimuth, camera.elevation = 8.8, 84.0, -8.5
    renderer = mujoco.Renderer(model, SIZE[1], SIZE[0])
    try:
        renderer.update_scene(data, camera)
        for i, frame in enumerate(frames):
            for foot, force, colour in frame.arrows:
                add_arrow(renderer.scene, foot + [i * SPACING, 0, 0], force * FORCE_SCALE, colour)
        matplotlib.image.imsave(path, renderer.render())
    finally:
        renderer.close()


def add_arrow(scene: Any, foot: Array, arrow: Array, colour: tuple[float, ...]) -> None:
    """Add an arrow to a scene, m."""
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom,
        mujoco.mjtGeom.mjGEOM_ARROW,
        np.zeros(3),
        np.zeros(3),
        np.zeros(9),
        np.array(colour, dtype=np.float32),
    )
    mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, 0.012, foot, foot + arrow)
    scene.ngeom += 1


def main() -> None:
    """Draw all pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images"
    folder.mkdir(parents=True, exist_ok=True)

    draw("hrp4_class", push_frames("hrp4_class"), folder / "push.png")
    print(f"wrote {folder / 'push.png'}")
    render_ground.draw_all(folder)
    render_walk.draw(folder / "walk.webp")
    render_walk.draw(folder / "drive.webp", render_walk.DRIVE)


if __name__ == "__main__":
    main()
