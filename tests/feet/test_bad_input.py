"""Values that feet, sensors and profiles refuse: the type of the error and what it names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from wbc.base.errors import InputError
from wbc.feet import SoftFoot, StiffnessModel, VariableStiffnessFoot, foot, register_foot
from wbc.feet.sensing.roughness import roughness
from wbc.feet.sensing.scan import GroundScan, ScanSettings
from wbc.feet.soles.foot import AnkleSole, FootFit

OWN = AnkleSole.under_ankle(0.093, 0.16, 0.076)
GRID, FLAT = 0.007 * np.arange(20), np.zeros(20)


@dataclass(frozen=True)
class Undecorated(SoftFoot):
    """A foot whose new field its inherited constructor does not take."""

    toe: float = 0.1


REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: foot("soft", thickness=0.01), "thickness|fit"),
    (lambda: foot("soft", loop_phalanx=10), "loop_phalanx"),
    (lambda: foot("variable", stiffness=2001.0), "stiffness"),
    (lambda: foot("soft", ankle_height=0.02).fit(OWN), "ankle"),
    (lambda: AnkleSole("a", (0.0, 0.0, -0.1), (0.0, 0.0, 0.0, 2.0), 0.1, 0.1), "quaternion"),
    (lambda: ScanSettings(max_gap=0.001), "max_gap"),
    (lambda: GroundScan().start((0.0, 0.0)), "direction"),
    (lambda: GroundScan().profile(), "hits"),
    (lambda: roughness(GRID**2, FLAT), "even"),
    (lambda: roughness(GRID, FLAT[1:]), "shape"),
    (lambda: foot("flat").fit("left_foot"), "sole of FlatFoot.fit"),  # type: ignore[arg-type]
    (lambda: foot("soft").fit(None), "sole of SoftFoot.fit"),  # type: ignore[arg-type]
    (lambda: FootFit(None, None), "FootFit"),  # type: ignore[arg-type]
    (lambda: register_foot("undecorated", Undecorated), "'toe' of Undecorated .* @settings"),
    (lambda: register_foot("soft", VariableStiffnessFoot), "'soft' is registered already"),
    (lambda: StiffnessModel.load(3), "path of StiffnessModel.load"),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("call", "named"), REFUSED)
def test_a_value_that_cannot_be_used_is_refused(call: Callable[[], object], named: str) -> None:
    with pytest.raises(InputError, match=named):
        call()
