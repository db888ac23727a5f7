"""Films of tracked motions; on a machine without a display set MUJOCO_GL=egl.

PYTHONPATH=tests/support python docs/render_motion.py                  # images/motion.webp
PYTHONPATH=tests/support python docs/render_motion.py --clip FILE --out docs/images/lift.webp  # a clip of g1, whole
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mujoco
from made_motions import make_motion
from PIL import Image
from render_walk import MARKS, brighten

import wbc
from wbc.app.replay.film import renderer
from wbc.app.view.stage import SimulatedStage
from wbc.motion import make_feasible, read_motion
from wbc.sim import TrackSpec
from wbc.sim.balance.tracking import TrackTrial
from wbc.sim.trial.loop import TrialHook

ROBOT, MOTION, SEED = "g1", "one_leg", 0
"""Robot, and motion that is filmed without a clip."""

START, SECONDS, RATE = 1.0, 7.0, 8.0
"""Beginning and length of that film, s, and pictures per second."""

CLIP_RATE = 5.0
"""Pictures per second of the film of a clip."""

SIZE = (320, 400)
"""Width and height, pixels."""


def main() -> None:
    """Track the motion and write the film."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clip", type=Path, help="clip to film whole, in place of the generated motion")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images" / "motion.webp")
    options = parser.parse_args()
    model = wbc.load_robot(ROBOT).robot()
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


if __name__ == "__main__":
    main()
