"""Films without a display: EGL unless told otherwise. Import it before MuJoCo, which reads this when it is imported."""

import os
import sys
from ctypes.util import find_library

if sys.platform == "linux" and not os.environ.get("DISPLAY") and find_library("EGL"):
    os.environ.setdefault("MUJOCO_GL", "egl")
