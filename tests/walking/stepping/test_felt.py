"""State that free steps feel: points of soles that carry, the DCM about them, and a wrench on the hands."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from placed_gait import CONSTANTS, DT, LEVEL, OMEGA, POINT, frame_of, gait_on
from point_mass import SCALE
from properties import examples

from wbc.walking.contact import GaitPhase
from wbc.walking.stepping.law import Divergent, StanceAxes

lengths, angles = st.floats(-0.6, 0.6), st.floats(-math.pi, math.pi)
places = st.tuples(lengths, lengths, lengths, angles, st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
feet = st.tuples(places, places)


def pressed(x: float, y: float, force: float) -> list[float]:
    """Wrench of a force on a sole at a point of it, in its frame, N and Nm."""
    return [0.0, 0.0, force, y * force, -x * force, 0.0]


@examples(20)
@given(feet, st.floats(-0.08, 0.08), st.floats(-0.029, 0.029), st.floats(0.1, 0.9))
def test_a_force_on_a_sole_acts_where_its_moments_say_and_within_its_edges(
    two: tuple[tuple[float, ...], tuple[float, ...]], x: float, y: float, share: float
) -> None:
    frames = frame_of(two[0]), frame_of(two[1])
    loads = share * SCALE.weight, (1.0 - share) * SCALE.weight
    wrenches = [pressed(x, y, loads[0]), pressed(9.0, -9.0, loads[1])]
    gait = gait_on(frames, wrenches=wrenches)
    length, width = SCALE.sole
    points = frames[0].act(np.array([x, y, 0.0])), frames[1].act(np.array([length, -width, 0.0]))
    for side in (0, 1):
        np.testing.assert_allclose(gait.felt.centre_of_pressure(side), points[side], atol=1e-12)
    np.testing.assert_allclose(
        gait.felt.contact_point(), share * points[0] + (1.0 - share) * points[1], atol=1e-12
    )
    for phase, ahead in ((GaitPhase.STANDING, 0.0), (GaitPhase.SINGLE, CONSTANTS.area.carrying)):
        gait.felt._begin(phase, 1)
        gait.felt.state = gait.felt.state._replace(wrenches=[[0.0] * 6] * 2)
        carrying = [frame.act(np.array([ahead, 0.0, 0.0])) for frame in frames]
        for side in (0, 1):
            np.testing.assert_allclose(gait.felt.centre_of_pressure(side), carrying[side], atol=1e-12)
        expected = carrying[1] if phase is GaitPhase.SINGLE else 0.5 * sum(carrying)
        np.testing.assert_allclose(gait.felt.contact_point(), expected, atol=1e-12)


@examples(20)
@given(angles, st.floats(0.15, 0.5), lengths, lengths, st.floats(0.3, 1.0))
def test_the_dcm_is_as_far_outside_the_standing_boxes_as_its_parts_along_the_line_of_the_feet_say(
    yaw: float, spacing: float, ahead: float, aside: float, share: float
) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    left = frame_of((0.3 - 0.5 * spacing * s, -0.2 + 0.5 * spacing * c, 0.0, yaw, 0.0, 0.0))
    right = frame_of((0.3 + 0.5 * spacing * s, -0.2 - 0.5 * spacing * c, 0.0, yaw, 0.0, 0.0))
    dcm = Divergent(0.3 + ahead * c - aside * s, -0.2 + ahead * s + aside * c, OMEGA)
    length, width = CONSTANTS.area.standing_box
    expected = max(abs(ahead) - 0.5 * share * length, abs(aside) - 0.5 * spacing - 0.5 * share * width)
    assert gait_on((left, right)).felt.outside(dcm, share) == pytest.approx(expected, abs=1e-8)


@examples(20)
@given(feet, angles, lengths, lengths)
def test_the_middle_of_a_stand_is_the_com_along_the_path_and_the_middle_of_the_feet_across_it(
    two: tuple[tuple[float, ...], tuple[float, ...]], heading: float, x: float, y: float
) -> None:
    frames = frame_of(two[0]), frame_of(two[1])
    gait = gait_on(frames, (x, y, SCALE.height), heading=heading)
    forward, left = (
        np.array([math.cos(heading), math.sin(heading)]),
        np.array([-math.sin(heading), math.cos(heading)]),
    )
    middle, between = np.array(gait._middle()), 0.5 * (frames[0].translation + frames[1].translation)[:2]
    assert forward @ middle == pytest.approx(forward @ (x, y), abs=1e-12)
    assert left @ middle == pytest.approx(left @ between, abs=1e-12)
    for side in (-1.0, 1.0):
        axes = StanceAxes(side, gait.steering.direction, POINT)
        assert axes.outwards(x, y) == pytest.approx((forward @ (x, y), side * (left @ (x, y))), abs=1e-12)


@pytest.mark.parametrize("phase", [GaitPhase.STANDING, GaitPhase.SINGLE])
def test_a_wrench_on_the_hands_moves_the_dcm_by_its_moment_about_the_contact_over_the_weight(
    phase: GaitPhase,
) -> None:
    gait = gait_on(LEVEL, com=(0.02, 0.05, SCALE.height), speed=(0.1, -0.2, 0.0))
    felt = gait.felt
    felt._begin(phase, 0)
    felt.follow()
    alone, (x, y, z) = felt.dcm, felt.contact
    for force, place, off in (
        ((0.0, 0.0, 40.0), (x, y, 1.0), (0.0, 0.0)),
        ((30.0, 0.0, 0.0), (0.4, 0.1, z + 0.9), (0.9 * 30.0, 0.0)),
        ((0.0, -20.0, 10.0), (x, y + 0.3, z + 1.0), (0.0, -20.0 - 3.0)),
    ):
        wrench = np.concatenate((force, np.cross(place, force)))
        felt.state = felt.state._replace(hand_wrench=wrench)
        felt.follow()
        moved = felt.dcm.x - alone.x, felt.dcm.y - alone.y
        assert moved == pytest.approx([part / SCALE.weight for part in off], abs=1e-9)


def test_the_dcm_with_the_offset_of_a_wrench_runs_away_from_the_contact_as_that_of_a_pendulum() -> None:
    """L̇ = (c − p) × m g + M, over a tick at a constant height; the offset of a constant wrench is constant."""
    wrench, tick = np.array([25.0, -15.0, 5.0, 3.0, -8.0, 1.0]), 1e-6
    com, speed = np.array((0.03, 0.04, SCALE.height)), np.array((0.2, -0.1, 0.0))
    gait = gait_on(LEVEL, com=tuple(com), speed=tuple(speed))
    felt = gait.felt
    felt._begin(GaitPhase.SINGLE, 0)
    felt.state = felt.state._replace(hand_wrench=wrench)
    felt.follow()
    before, contact = felt.dcm, np.array(felt.contact)
    moment = wrench[3:] - np.cross(contact, wrench[:3])
    change = np.cross(com - contact, (0.0, 0.0, -SCALE.weight)) + moment  # of L
    moved = com + tick * speed
    spin = tick * change + SCALE.mass * np.cross(com - moved, speed)  # what c × ċ does not have of it
    felt.state = felt.state._replace(com=moved.tolist(), spin=spin.tolist())
    felt.follow()
    rate = [(now - then) / tick for now, then in zip(felt.dcm[:2], before[:2], strict=True)]
    expected = [before.omega * (xi - p) for xi, p in zip(before[:2], contact, strict=False)]
    assert rate == pytest.approx(expected, rel=1e-4)


def test_a_shift_of_the_weight_begins_where_the_robot_leans_against_a_wrench_on_its_hands() -> None:
    """Hands move the CoM of the references by −δ, and from there the weight is shifted over one foot."""
    com, wrench = (0.03, 0.0, SCALE.height), np.array([-25.0, 4.0, 0.0, 0.0, 0.0, 0.0])
    wrench[3:] = np.cross((0.4, 0.0, 1.0), wrench[:3])
    gait = gait_on(LEVEL, com=com)
    gait.felt.state = gait.felt.state._replace(hand_wrench=wrench)
    gait.steering.command((0.2, 0.0, 0.0))
    while gait.felt.phase is GaitPhase.STANDING:
        reference = gait.advance(gait.felt.state, LEVEL)
    assert reference.progress.phase is GaitPhase.DOUBLE and reference.progress.elapsed < DT
    offset = np.array((wrench[4], -wrench[3])) / SCALE.weight  # about contacts at the origin
    assert np.linalg.norm(offset) > 0.02
    np.testing.assert_allclose(reference.pendulum.com[:2] - offset, com[:2], atol=1e-9)


@examples(10)
@given(places, st.tuples(angles, angles, angles))
def test_a_sole_tilts_at_the_rates_at_which_the_ends_of_its_axes_rise(
    place: tuple[float, ...], rate: tuple[float, float, float]
) -> None:
    frame, dt = frame_of(place), 1e-6
    gait = gait_on((frame, frame))
    state = gait.felt.state._replace(rates=(rate, rate))
    turned = pin.exp3(dt * np.array(rate)) @ frame.rotation
    rises = (turned[2, :2] - frame.rotation[2, :2]) / dt
    np.testing.assert_allclose(state.tilting(0), rises, atol=1e-4)
