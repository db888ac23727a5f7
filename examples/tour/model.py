"""The robot of the tour: a Unitree G1 with 29 joints, 35.1 kg, and the rotors, damping and feet of the benchmark.

g1.xml is Unitree's model with the convex hulls of its meshes, of eight vertices each, as the benchmark has them.
`python examples/tour/model.py FILE` makes it from their g1_29dof.xml with its meshes beside it, of
unitreerobotics/unitree_mujoco at c598f10 (BSD-3-Clause, the notice is in the file).
"""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

FILE = Path(__file__).with_name("g1.xml")

NOTICE = """ Unitree G1 with 29 joints: g1_29dof.xml of unitreerobotics/unitree_mujoco at c598f10, its meshes as hulls.

BSD 3-Clause License

Copyright (c) 2016-2024 HangZhou YuShu TECHNOLOGY CO.,LTD. ("Unitree Robotics")
All rights reserved.

Redistribution and use in source and binary forms, with or without
modification, are permitted provided that the following conditions are met:

* Redistributions of source code must retain the above copyright notice, this
  list of conditions and the following disclaimer.

* Redistributions in binary form must reproduce the above copyright notice,
  this list of conditions and the following disclaimer in the documentation
  and/or other materials provided with the distribution.

* Neither the name of the copyright holder nor the names of its
  contributors may be used to endorse or promote products derived from
  this software without specific prior written permission.

THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS"
AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE
DISCLAIMED. IN NO EVENT SHALL THE COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE
FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL
DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR
SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS INTERRUPTION) HOWEVER
CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT LIABILITY,
OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE
OF THIS SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.
"""


def _joints(part: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{part}{name}_joint" for name in names)


LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_roll", "wrist_pitch", "wrist_yaw")
WAIST = ("waist_yaw", "waist_roll", "waist_pitch")

LEGS_AND_WAIST = (*_joints("left_", *LEG), *_joints("right_", *LEG), *_joints("", *WAIST))
ARMS = (*_joints("left_", *ARM), *_joints("right_", *ARM))
JOINTS = (*LEGS_AND_WAIST, *ARMS)
"""All joints in the order of the benchmark."""

SMALL, LIGHT, MIDDLE, LARGE = 0.003609725, 0.00425, 0.010177520, 0.025101925
"""Inertia of the rotors of the four kinds of motor, behind the gear, kg m²."""

_OF_LEG = (LARGE, LARGE, MIDDLE, LARGE, 2 * SMALL, 2 * SMALL)
_OF_ARM = (SMALL, SMALL, SMALL, SMALL, SMALL, LIGHT, LIGHT)
ARMATURE = dict(
    zip(JOINTS, (*_OF_LEG, *_OF_LEG, MIDDLE, 2 * SMALL, 2 * SMALL, *_OF_ARM, *_OF_ARM), strict=True)
)
"""Inertia of each joint's rotor, kg m²: ankles, waist roll and waist pitch have two motors."""

GAINS = ("*=40,1", "*hip*=60,1", "*knee*=100,2", "waist_yaw_joint=60,1")
"""Gains of the machine's servos, Nm/rad and Nms/rad: those of Unitree's example for the G1 (unitree_sdk2_python at
37116c5, example/g1/low_level/g1_low_level_example.py)."""

FRICTION, STEP = 0.01, 0.002
"""Damping, Nms/rad, and dry friction, Nm, of every joint; physics step, s."""

VERTICES = 8
"""Most vertices of a collision hull."""


def load() -> mujoco.MjModel:
    """Return the model, on a floor."""
    spec = mujoco.MjSpec.from_file(str(FILE))
    for joint in spec.joints:
        if joint.name in ARMATURE:
            joint.armature, joint.frictionloss = ARMATURE[joint.name], FRICTION
            joint.damping = [FRICTION, 0.0, 0.0] if hasattr(joint.damping, "__len__") else FRICTION
    spec.option.timestep, spec.option.integrator = STEP, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05])
    return spec.compile()


def with_hulls(file: Path) -> str:
    """Return Unitree's model with a hull for each mesh that collides, without classes of joints and single readings.

    Their rubber hands do not collide; those of the benchmark do.
    """
    spec = mujoco.MjSpec.from_file(str(file))
    for mesh in spec.meshes:
        mesh.maxhullvert = VERTICES
    for geom in spec.geoms:
        geom.contype = geom.conaffinity = 1  # meshes that do not collide get no hull
    compiled = spec.compile()
    source = ET.parse(file).getroot()
    root = ET.Element("mujoco", {"model": "g1"})
    root.append(ET.Element("compiler", {"angle": "radian"}))
    hulls = ET.SubElement(root, "asset")
    for part in ("worldbody", "actuator", "sensor"):
        found = source.find(part)
        assert found is not None
        root.append(found)
    for parent in list(root.iter()):
        for child in list(parent):
            child.attrib.pop("class", None)
            if parent.tag == "sensor" and child.tag not in ("gyro", "accelerometer"):
                parent.remove(child)
            elif child.tag == "geom" and "mesh" in child.attrib:
                name = child.attrib["mesh"]
                if "rubber_hand" in name:
                    child.attrib.pop("contype", None)
                    child.attrib.pop("conaffinity", None)
                if child.get("contype") == "0":
                    parent.remove(child)
                elif hulls.find(f"mesh[@name='{name}']") is None:
                    ET.SubElement(hulls, "mesh", {"name": name, "vertex": _hull(compiled, name)})
    ET.indent(root)
    return f"<!--{NOTICE}-->\n{ET.tostring(root, encoding='unicode')}\n"


def _hull(compiled: mujoco.MjModel, name: str) -> str:
    """Return the vertices of a mesh's convex hull, in the axes of its file, m."""
    mesh = compiled.mesh(name).id
    first = compiled.mesh_graphadr[mesh]
    count = compiled.mesh_graph[first]
    chosen = compiled.mesh_graph[first + 2 + count : first + 2 + 2 * count]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, compiled.mesh_quat[mesh])
    vertices = compiled.mesh_vert[compiled.mesh_vertadr[mesh] + chosen] @ turn.reshape(3, 3).T
    return " ".join(f"{value:.5f}" for value in (vertices + compiled.mesh_pos[mesh]).ravel())


if __name__ == "__main__":
    FILE.write_text(with_hulls(Path(sys.argv[1])), encoding="utf-8")
