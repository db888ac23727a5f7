"""A biped in MJCF that has, on purpose, what files of other people have and a reader must not assume away."""

from __future__ import annotations

BIPED = """
<mujoco model="little_biped">
  <compiler angle="degree" autolimits="true"/>
  <option gravity="0 0 -9.80665"/>
  <default>
    <joint armature="0.02" damping="0.5" frictionloss="0.1"/>
    <default class="foot"><geom size="0.01" contype="1" conaffinity="1"/></default>
    <default class="leg"><joint axis="0 1 0" range="-120 120"/><geom contype="0" conaffinity="0"/></default>
  </default>
  <worldbody>
    <geom name="ground" type="plane" size="5 5 0.1"/>
    <body name="ball" pos="2 0 0.1"><freejoint/><geom type="sphere" size="0.1"/></body>
    <body name="pelvis" pos="0 0 0.9">
      <freejoint name="floating"/>
      <inertial pos="0.01 0 0.05" mass="9" diaginertia="0.08 0.06 0.05"/>
      <site name="imu_here" pos="-0.02 0.01 0.1" euler="0 0 90"/>
      {left}
      {right}
      <body name="chest" pos="0 0 0.15">
        <joint name="waist" axis="0 0 1" range="-80 80"/>
        <inertial pos="0 0 0.15" mass="12" fullinertia="0.2 0.15 0.1 0.01 0.02 0.005"/>
        <frame pos="0 0.2 0.3" euler="10 0 0">
          <body name="left_arm">
            <joint name="left_shoulder" axis="0 1 0" range="-170 170"/>
            <joint name="left_shoulder_out" axis="1 0 0" pos="0 0 -0.02" range="-20 100"/>
            <geom type="capsule" size="0.03" fromto="0 0 -0.02 0 0 -0.4" contype="0" conaffinity="0"/>
          </body>
        </frame>
        <body name="right_arm" pos="0 -0.2 0.3" quat="0.9 0.1 0 0.2">
          <joint name="right_shoulder" axis="0 1 0" range="-170 170"/>
          <joint name="right_reach" type="slide" axis="0 0.6 -0.8" range="-0.1 0.2"/>
          <geom type="capsule" size="0.03" fromto="0 0 -0.02 0 0 -0.4" contype="0" conaffinity="0"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="wrong_order_first" joint="waist" kp="200" kv="10" forcerange="-60 60"/>
    {drives}
  </actuator>
  <sensor>
    <gyro name="turning" site="imu_here"/>
    <accelerometer name="pushing" site="imu_here"/>
    <force name="left_load" site="left_load_cell"/>
  </sensor>
  {extra}
</mujoco>
"""

LEG = """
<body name="{side}_hip" pos="0 {y} -0.05" childclass="leg">
  <joint name="{side}_hip_yaw" axis="0 0 1" range="-60 60"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.002 0.002 0.002"/>
  <body name="{side}_thigh">
    <joint name="{side}_hip_roll" axis="1 0 0" range="-40 40"/>
    <joint name="{side}_hip_pitch" axis="0 1 0"/>
    <geom type="capsule" size="0.05" fromto="0 0 -0.05 0 0 -0.35" mass="3"/>
    <body name="{side}_shin" pos="0.01 0 -0.37">
      <joint name="{side}_knee" pos="-0.01 0 0.01" ref="20" range="-5 140"/>
      <geom type="capsule" size="0.04" fromto="0 0 -0.03 0 0 -0.33" mass="2"/>
      <body name="{side}_ankle" pos="0 0 -0.37">
        <joint name="{side}_ankle_pitch" range="-60 60"/>
        <inertial pos="0 0 0" mass="0.3" diaginertia="0.0004 0.0004 0.0004"/>
        <body name="{side}_foot">
          <joint name="{side}_ankle_roll" axis="1 0 0" range="-30 30"/>
          <inertial pos="0.02 0 -0.03" mass="0.8" diaginertia="0.001 0.002 0.002"/>
          <site name="{side}_load_cell" pos="0 0 -0.03"/>
          {foot}
        </body>
      </body>
    </body>
  </body>
</body>
"""

CAPSULES = """
<geom class="foot" type="capsule" fromto="-0.06 0.04 -0.06 0.13 0.04 -0.06"/>
<geom class="foot" type="capsule" fromto="-0.06 -0.04 -0.06 0.13 -0.04 -0.06"/>
"""

MOTORS = "\n".join(
    f'<motor joint="{side}_{joint}" gear="2" ctrlrange="-40 40"/>'
    for side in ("right", "left")
    for joint in ("ankle_roll", "ankle_pitch", "knee", "hip_pitch", "hip_roll", "hip_yaw")
) + "".join(
    f'<motor joint="{joint}"/>'
    for joint in ("left_shoulder", "left_shoulder_out", "right_shoulder", "right_reach")
)


def biped(foot: str = CAPSULES, drives: str = MOTORS, extra: str = "") -> str:
    """Return the biped with geoms of the feet, drives and further sections of one's own."""
    return BIPED.format(
        left=LEG.format(side="left", y=0.1, foot=foot),
        right=LEG.format(side="right", y=-0.1, foot=foot),
        drives=drives,
        extra=extra,
    )
