"""Actuators of the joints of a compiled MuJoCo model, and the options of the model that switch forces off.

MuJoCo numbers actuators, their controls and their force outputs apart: an actuator of the kind `pid` owns up to three
controls. What an actuator does is read here, for the reader of robots and for the loop that drives them.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from wbc.base.numbers import Array

_OFF, _KIND = mujoco.mjtDisableBit, mujoco.mjtTrn

LAGGING = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
"""Dynamics of actuators that act on a control after a lag of the first order."""


@dataclass(frozen=True)
class JointActuator:
    """An actuator that turns a joint: its force on the joint is gear (gain u + b₀ + b₁ gear q + b₂ gear q̇).

    Attributes:
        number: Number of the actuator.
        name: Its name, or that of its joint.
        joint: Number of its joint.
        gear: Ratio from the actuator to the joint.
        control: Number of the control u, and `controls`, that of all its controls; the others are zero.
        controls: See `control`.
        gain: Force by control; None where the force is no such function of one control.
        bias: b₀, b₁ and b₂, shape (3,).
        on: False for an actuator whose group the file switches off (`actuatorgroupdisable`).
        lag: Time constant between control and force, s.
        delay: Delay of the control, s.
        kind: Kind of the force where `gain` is None, such as "muscle"; "motor" otherwise.
    """

    number: int
    name: str
    joint: int
    gear: float
    control: int
    controls: tuple[int, ...]
    gain: float | None
    bias: Array
    on: bool
    lag: float
    delay: float
    kind: str


def switched_off(model: mujoco.MjModel, flag: mujoco.mjtDisableBit) -> bool:
    """Return True if an option flag of the file switches a kind of force off."""
    return bool(int(model.opt.disableflags) & int(flag))


def equalities_off(model: mujoco.MjModel) -> bool:
    """Return True if the option flags of the file switch all equalities off."""
    return switched_off(model, _OFF.mjDSBL_EQUALITY) or switched_off(model, _OFF.mjDSBL_CONSTRAINT)


def actuators(model: mujoco.MjModel) -> list[JointActuator]:
    """Return all actuators that turn a joint of one coordinate or push a free one, by their numbers."""
    found = []
    for i in range(model.nactuator):
        if int(model.actuator_trntype[i]) not in (int(_KIND.mjTRN_JOINT), int(_KIND.mjTRN_JOINTINPARENT)):
            continue
        gain, kind = _gain(model, i)
        affine = int(model.actuator_biastype[i]) == int(mujoco.mjtBias.mjBIAS_AFFINE)
        lag = float(model.actuator_dynprm[i, 0])
        first = int(model.actuator_ctrladr[i])
        found.append(
            JointActuator(
                number=i,
                name=actuator_name(model, i),
                joint=int(model.actuator_trnid[i, 0]),
                gear=gear_of(model, i),
                control=first,
                controls=tuple(range(first, first + int(model.actuator_ctrlnum[i]))),
                gain=gain,
                bias=np.array(model.actuator_biasprm[i, :3]) if affine else np.zeros(3),
                on=acts(model, i),
                lag=lag if int(model.actuator_dyntype[i]) in LAGGING else 0.0,
                delay=float(model.actuator_delay[i]),
                kind=kind,
            )
        )
    return found


def driven(model: mujoco.MjModel) -> set[int]:
    """Return the joints that an actuator drives which is not switched off."""
    return {each.joint for each in actuators(model) if each.gear != 0.0 and each.on}


def actuator_name(model: mujoco.MjModel, actuator: int) -> str:
    """Return the name of an actuator, or of what it drives where it has none."""
    kinds, objects = mujoco.mjtTrn, mujoco.mjtObj
    kind = {
        int(kinds.mjTRN_TENDON): objects.mjOBJ_TENDON,
        int(kinds.mjTRN_SITE): objects.mjOBJ_SITE,
        int(kinds.mjTRN_BODY): objects.mjOBJ_BODY,
    }.get(int(model.actuator_trntype[actuator]), objects.mjOBJ_JOINT)
    driven = mujoco.mj_id2name(model, kind, int(model.actuator_trnid[actuator, 0]))
    return str(model.actuator(actuator).name or driven or f"actuator {actuator}")


def acts(model: mujoco.MjModel, actuator: int) -> bool:
    """Return False for an actuator whose group is switched off."""
    group = int(model.actuator_group[actuator])
    return not (0 <= group < 31 and int(model.opt.disableactuator) >> group & 1)


def gear_of(model: mujoco.MjModel, actuator: int) -> float:
    """Return the ratio of the first force output of an actuator."""
    return float(model.actuator_gear[int(model.actuator_outadr[actuator]), 0])


def of_joints(model: mujoco.MjModel, values: Array) -> Array:
    """Return gear² × value of the actuators, shape (nactuator,), summed by the velocities that they turn, (nv,)."""
    total = np.zeros(model.nv)
    for each in actuators(model):
        total[int(model.jnt_dofadr[each.joint])] += each.gear**2 * values[each.number]
    return total


def rotor_inertia(model: mujoco.MjModel) -> Array:
    """Return the inertia of rotors, of joints and of their actuators, by velocities, shape (nv,), kg m² or kg."""
    return np.asarray(model.dof_armature + of_joints(model, model.actuator_armature))


def damping(model: mujoco.MjModel) -> Array:
    """Return the linear damping of joints and of their actuators that acts, by velocities, shape (nv,)."""
    if switched_off(model, _OFF.mjDSBL_DAMPER):
        return np.zeros(model.nv)
    return np.asarray(model.dof_damping + of_joints(model, model.actuator_damping))


def dry_friction(model: mujoco.MjModel) -> Array:
    """Return the dry friction of joints that acts, by velocities, shape (nv,), Nm or N."""
    off = switched_off(model, _OFF.mjDSBL_FRICTIONLOSS) or switched_off(model, _OFF.mjDSBL_CONSTRAINT)
    return np.zeros(model.nv) if off else np.array(model.dof_frictionloss)


def stiffness(model: mujoco.MjModel) -> Array:
    """Return the linear stiffness of the springs of joints that acts, shape (njnt,), Nm/rad or N/m."""
    return np.zeros(model.njnt) if switched_off(model, _OFF.mjDSBL_SPRING) else np.array(model.jnt_stiffness)


def _gain(model: mujoco.MjModel, actuator: int) -> tuple[float | None, str]:
    """Return the force by control of an actuator, and "motor"; None and what it is for another kind."""
    gain = mujoco.mjtGain(int(model.actuator_gaintype[actuator]))
    bias = mujoco.mjtBias(int(model.actuator_biastype[actuator]))
    dynamics = mujoco.mjtDyn(int(model.actuator_dyntype[actuator]))
    words = {each.name.split("_", 1)[1].lower() for each in (gain, bias, dynamics)}
    odd = words - {"fixed", "none", "affine", "filter", "filterexact"}
    if int(model.actuator_plugin[actuator]) >= 0:
        return None, "plugin"
    if gain == mujoco.mjtGain.mjGAIN_AFFINE:
        return None, "gain that depends on position or velocity, such as a damper's"
    if odd == {"pid"} and dynamics != mujoco.mjtDyn.mjDYN_PID and int(model.actuator_ctrlspec[actuator]) & 1:
        return -float(model.actuator_biasprm[actuator, 1]), "motor"  # its first control is a position
    if odd:
        whole = {
            "pid": "pid with an integral, a bound of its speed or no position",
            "integrator": "integrated control",
        }
        return None, ", ".join(whole.get(word, word) for word in sorted(odd))
    return float(model.actuator_gainprm[actuator, 0]), "motor"
