"""Vectors as plain numbers against Pinocchio."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from wbc.base.vectors import add_cross, along, largest, part_way, quaternion, turned, turned_all


def rotations() -> list[np.ndarray]:
    """Random ones, and half turns, for which the trace says nothing about the sign."""
    rng = np.random.default_rng(0)
    turns = [pin.exp3(3.0 * rng.standard_normal(3)) for _ in range(200)]
    axes = (*np.eye(3), (1.0, 1.0, 0.0), (0.0, -1.0, 1.0), (1.0, 2.0, -3.0))
    for angle in (0.0, 1e-9, np.pi - 1e-7, np.pi):
        turns += [
            pin.AngleAxis(angle, np.array(axis) / np.linalg.norm(axis)).toRotationMatrix() for axis in axes
        ]
    return turns


def test_quaternions_are_those_of_pinocchio() -> None:
    for rotation in rotations():
        got = np.array(quaternion(rotation.tolist()))
        assert np.linalg.norm(got) == pytest.approx(1.0, abs=1e-14)
        want = pin.Quaternion(rotation).coeffs()
        np.testing.assert_allclose(got * np.sign(got @ want), want, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(pin.Quaternion(got).matrix(), rotation, rtol=0.0, atol=1e-9)


def test_products() -> None:
    rng = np.random.default_rng(1)
    for rotation in rotations()[:20]:
        a, b, c = rng.standard_normal((3, 3))
        np.testing.assert_allclose(turned(rotation.tolist(), a.tolist()), rotation @ a, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(add_cross(a, b, c), a + np.cross(b, c), rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(part_way(a, b, 0.25), 0.75 * a + 0.25 * b, rtol=0.0, atol=1e-14)
        np.testing.assert_allclose(
            turned_all(rotation.tolist(), [a, b]), [rotation @ a, rotation @ b], atol=1e-14
        )
        angle = a[2]
        turn = pin.utils.rotate("z", angle)[:2, :2]
        parts = along((np.cos(angle), np.sin(angle)), b[0], b[1])
        np.testing.assert_allclose(parts, turn.T @ b[:2], rtol=0.0, atol=1e-14)
        assert largest(a) == a.max()
    assert largest(np.zeros(0)) == -np.inf and np.isnan(largest(np.array([1.0, np.nan, 2.0])))
