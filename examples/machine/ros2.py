"""Stand over ROS 2: `python examples/machine/ros2.py ROBOT`. Not tested: there is no ROS 2 where this library is made.

In come joint states, IMU and sole wrenches; out goes an array of five rows: torque, position, velocity, kp and kd. The
node at the robot applies them as `wbc.Command` says, and damps the joints by itself when nothing comes any more.
"""

import sys
import time
from functools import cached_property

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

import wbc

TOPICS = {"joint_states": JointState, "imu": Imu, "left_sole": WrenchStamped, "right_sole": WrenchStamped}


class RosDriver(wbc.machine.Driver):
    """Driver of `wbc.run`; its node is made at the first call, as the guard of the run is another process."""

    def __init__(self, robot):
        self.description, self.joints, self.last = robot, robot.robot().joint_names, {}
        self.gains = robot.kp, robot.kd

    @cached_property
    def out(self):  # noqa: D102
        rclpy.init()
        self.node = rclpy.create_node("wbc")
        for topic, kind in TOPICS.items():
            keep = lambda message, name=topic: self.last.update({name: message})  # noqa: E731
            self.node.create_subscription(kind, topic, keep, qos_profile_sensor_data)
        return self.node.create_publisher(Float64MultiArray, "joint_command", 1)

    def read(self, timeout):  # noqa: D102 - waits for new joint states; of the other topics the last message counts
        end, _ = time.monotonic() + timeout, self.out
        while not TOPICS.keys() <= self.last.keys():
            if (left := end - time.monotonic()) < 0.0:
                return None
            rclpy.spin_once(self.node, timeout_sec=left)
        joints, imu, *soles = (self.last[topic] for topic in TOPICS)
        del self.last["joint_states"]
        order = [joints.name.index(name) for name in self.joints]
        q, v, torque = (np.array(part)[order] for part in (joints.position, joints.velocity, joints.effort))
        gyro, force = np.array([xyz(imu.angular_velocity), xyz(imu.linear_acceleration)])  # +9.81 at rest
        on_soles = np.array([xyz(s.wrench.force) + xyz(s.wrench.torque) for s in soles])  # in their frames
        when = joints.header.stamp.sec + 1e-9 * joints.header.stamp.nanosec
        return wbc.Measurement(when, q, v, gyro, force, on_soles, joint_torque=torque)

    def write(self, command):  # noqa: D102
        kp, kd = np.array(self.gains) * (
            command.joint_position is not None
        )  # without a position the servos are off
        own = {"joint_torque": 0, "joint_position": 0 * kp, "joint_velocity": 0 * kp, "kp": kp, "kd": kd}
        given = {name: getattr(command, name) for name in own}
        rows = [own[name] if row is None else row for name, row in given.items()]
        self.out.publish(Float64MultiArray(data=np.concatenate(rows).tolist()))

    def damp(self):  # noqa: D102
        self.write(wbc.Command(0.0 * self.gains[1], kd=self.gains[1]))


def xyz(vector):  # noqa: D103
    return [vector.x, vector.y, vector.z]


if __name__ == "__main__":
    robot = wbc.load_robot(sys.argv[1])
    control = wbc.TorqueControl(wbc.balance_controller(robot.robot(), 0.002))
    print(wbc.run(RosDriver(robot), control, rate=500))
