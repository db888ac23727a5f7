"""Film a tracked motion: `python docs/render_motion.py`; on a machine without a display set MUJOCO_GL=egl."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
from PIL import Image
from render_walk import brighten

import wbc
from wbc.app.replay.mujoco_scene import MujocoScene
from wbc.app.scene import PlantSource
from wbc.motion import make_feasible, make_motion
from wbc.sim import TrackSpec, TrackTrial

ROBOT, MOTION, SEED = "g1", "one_leg", 0
"""Robot and motion that are filmed."""

START, SECONDS, RATE = 1.0, 7.0, 8.0
"""Beginning and length of the film, s, and pictures per second."""

SIZE = (320, 400)
"""Width and height, pixels."""


def main() -> None:
    """Track the motion and write the film."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "images" / "motion.webp"
    model = wbc.load_robot(ROBOT).robot()
    trial = TrackTrial(make_feasible(model, make_motion(model, MOTION, SEED)).clip, TrackSpec(robot=ROBOT))
    plant, source = trial.plant, PlantSource(trial.plant)
    scene = source.scene
    drawn = MujocoScene(scene, plant.terrain, *SIZE)
    brighten(drawn.model)
    camera = mujoco.MjvCamera()
    camera.distance, camera.azimuth, camera.elevation = 3.0 * scene.com_height, 150.0, -12.0
    camera.lookat[:] = (*source.snapshot().com[:2], scene.floor + 0.9 * scene.com_height)
    frames: list[Image.Image] = []
    with mujoco.Renderer(drawn.model, SIZE[1], SIZE[0]) as renderer:

        def film() -> None:
            if len(frames) < SECONDS * RATE and plant.time >= START + len(frames) / RATE:
                drawn.set(scene.frame(source.snapshot()))
                renderer.update_scene(drawn.data, camera)
                frames.append(Image.fromarray(renderer.render()))

        if not trial.run(film).completed:
            raise RuntimeError("the filmed robot has fallen")
    duration = round(1000.0 / RATE)
    frames[0].save(
        path, save_all=True, append_images=frames[1:], duration=duration, loop=0, quality=60, method=4
    )
    print(f"wrote {path}, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
