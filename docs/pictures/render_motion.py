"""Films of tracked motions; on a machine without a display set MUJOCO_GL=egl.

python docs/pictures/render_motion.py                  # images/motion.webp
python docs/pictures/render_motion.py --clip FILE --out docs/images/lift.webp  # a clip of g1, whole
python docs/pictures/render_motion.py --person         # images/person.png: a person, and g1 below
"""

from __future__ import annotations

import argparse
from pathlib import Path

from arguments import IMAGES  # isort: skip - puts made_motions on the path, too
import matplotlib
import matplotlib.pyplot as plt
import mujoco
import numpy as np
from made_motions import make_motion
from made_person import make_person
from PIL import Image
from render_walk import MARKS, brighten

import wbc
from wbc.app.replay.film import renderer
from wbc.app.view.stage import SimulatedStage
from wbc.motion import SkeletonClip, make_feasible, read_motion, retarget
from wbc.sim import TrackSpec
from wbc.sim.balance.tracking import TrackTrial
from wbc.sim.trial.trial import TrialHook

ROBOT, MOTION, SEED = "g1", "one_leg", 0
"""Robot, and motion that is filmed without a clip."""

START, SECONDS, RATE = 1.0, 7.0, 8.0
"""Beginning and length of that film, s, and pictures per second."""

CLIP_RATE = 5.0
"""Pictures per second of the film of a clip."""

SIZE = (320, 400)
"""Width and height, pixels."""

POSES = (0.5, 2.0, 4.6, 7.3, 11.0)
"""Times in the clip of the person that are shown, s."""

BONES = (
    ("left_hip", "right_hip", "right_shoulder", "left_shoulder", "left_hip"),
    *((f"{side}_hip", f"{side}_knee", f"{side}_ankle", f"{side}_toe") for side in ("left", "right")),
    *((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist") for side in ("left", "right")),
)
"""Joints of a person that lines of the drawing go through."""


def main() -> None:
    """Track the motion and write the film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clip", type=Path, help="clip to film whole, in place of the generated motion")
    parser.add_argument("--out", type=Path, default=IMAGES / "motion.webp")
    parser.add_argument("--person", action="store_true", help="draw a person and the robot that follows")
    options = parser.parse_args()
    model = wbc.load_robot(ROBOT).robot()
    if options.person:
        draw_person(IMAGES / "person.png")
        return
    if options.clip is None:
        given, start, rate = make_motion(model, MOTION, SEED), START, RATE
    else:
        given, start, rate = read_motion(options.clip), 0.0, CLIP_RATE
    clip = make_feasible(model, given).clip
    count = round(rate * (SECONDS if options.clip is None else clip.duration))
    trial = TrackTrial(clip, TrackSpec(robot=ROBOT), visuals=True)
    plant, stage = trial.plant, SimulatedStage(trial.plant, None)
    brighten(stage.model)
    camera = mujoco.MjvCamera()
    height = float(model.com[2])  # at half-sitting: a clip may begin bent
    camera.distance, camera.azimuth, camera.elevation = 3.0 * height, 150.0, -12.0
    camera.lookat[2] = stage.floor + 0.9 * height
    frames: list[Image.Image] = []
    with renderer(stage.model, *SIZE, samples=4) as drawn:

        def film() -> None:
            if len(frames) < count and plant.time >= start + len(frames) / rate:
                picture = stage.picture()
                picture.marks = [mark for mark in picture.marks if mark.name in MARKS]
                if not frames or options.clip is not None:  # a robot that walks is followed
                    camera.lookat[:2] = picture.target[:2]
                frames.append(Image.fromarray(drawn.draw(stage, picture, camera)))

        class Film(TrialHook):
            """Draws the pictures that are due."""

            def after(self, trial: TrackTrial) -> None:
                """See `TrialHook`."""
                film()

        if not trial.run([Film()]).completed:
            raise RuntimeError("the filmed robot has fallen")
    duration = round(1000.0 / rate)
    frames[0].save(
        options.out, save_all=True, append_images=frames[1:], duration=duration, loop=0, quality=60, method=4
    )
    print(f"wrote {options.out}, {options.out.stat().st_size} bytes")


def draw_person(out: Path) -> None:
    """Draw poses of the person that the tests make, and below each of them the robot that tracks the motion."""
    robot, person = wbc.load_robot(ROBOT).robot(), make_person()
    feasible = make_feasible(robot, retarget(person, robot).clip)
    trial = TrackTrial(feasible.clip, TrackSpec(robot=ROBOT, mode="torque"), visuals=True)
    plant, stage = trial.plant, SimulatedStage(trial.plant, None)
    brighten(stage.model)
    camera = mujoco.MjvCamera()
    height = float(robot.com[2])
    camera.distance, camera.azimuth, camera.elevation = 3.2 * height, 145.0, -8.0
    camera.lookat[2] = stage.floor + 0.8 * height
    due = [float(np.searchsorted(feasible.source_times, time)) / feasible.clip.rate for time in POSES]
    pictures: list[Image.Image] = []
    with renderer(stage.model, *SIZE, samples=4) as drawn:

        class Poses(TrialHook):
            """Draws the poses that are due."""

            def after(self, trial: TrackTrial) -> None:
                """See `TrialHook`."""
                if len(pictures) < len(due) and plant.time >= due[len(pictures)]:
                    picture = stage.picture()
                    picture.marks = []
                    camera.lookat[:2] = picture.target[:2]
                    pictures.append(Image.fromarray(drawn.draw(stage, picture, camera)))

        if not trial.run([Poses()]).completed:
            raise RuntimeError("the drawn robot has fallen")
    width, high = SIZE
    whole = Image.new("RGB", (width * len(POSES), 2 * high), "white")
    for column, time in enumerate(POSES):
        whole.paste(_sticks(person, time), (column * width, 0))
        whole.paste(pictures[column], (column * width, high))
    whole = whole.quantize(128)
    whole.save(out, optimize=True)
    print(f"wrote {out}, {out.stat().st_size} bytes")


def _sticks(person: SkeletonClip, time: float) -> Image.Image:
    """Return a drawing of the person at a time, s, seen as the camera sees the robot."""
    matplotlib.use("Agg")
    limbs, frame = person.limbs(), round(time * person.rate)
    angle = np.radians(145.0 - 90.0)
    middle = 0.5 * (limbs["left_ankle"][frame] + limbs["right_ankle"][frame])
    figure = plt.figure(figsize=(SIZE[0] / 100, SIZE[1] / 100), dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for bone in BONES:
        points = np.array([limbs[joint][frame] for joint in bone]) - middle * (1.0, 1.0, 0.0)
        across = points[:, 0] * np.cos(angle) + points[:, 1] * np.sin(angle)
        right = any("right" in joint for joint in bone) and not any("left" in joint for joint in bone)
        axes.plot(across, points[:, 2], "-o", color="tab:orange" if right else "tab:blue", linewidth=4)
    axes.axhline(0.0, color="grey", linewidth=1)
    axes.set(xlim=(-0.8, 0.8), ylim=(-0.15, 1.85), aspect="equal")
    axes.axis("off")
    figure.canvas.draw()
    image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])  # type: ignore[attr-defined]
    plt.close(figure)
    return image


if __name__ == "__main__":
    main()
