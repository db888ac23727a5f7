"""Two more stiffness policies: by the phase of the step, and by edges under the toe.

python examples/paper/policies.py phase --journal phase.jsonl --workers 2      # as `wbc study run`, with them
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import ClassVar

from walks import STUDIES

from wbc.sim.studies import Journal, Study, read_journal, study_table, sweep
from wbc.tasks import StiffnessPolicy, SwingScan, register_stiffness_policy


class PhasePolicy(StiffnessPolicy):
    """Stiffness by the phase of the step, whatever the ground: stiff while a foot lands and takes over the weight."""

    needs_scan: ClassVar[bool] = False

    def __init__(self, landing: float = 400.0, double: float = 400.0, single: float = 5.0) -> None:
        """Set the stiffness of the swing and its end, of both feet, and of the foot that stands alone, Nm/rad."""
        self.landing, self.double, self.single = landing, double, single

    def standing(self, single: bool) -> float:
        """See `StiffnessPolicy.standing`."""
        return self.single if single else self.double

    def decide(self, swing: SwingScan) -> float:
        """Return the stiffness of the landing."""
        return self.landing


class EdgePolicy(StiffnessPolicy):
    """Stiff landings over an edge, soft ones elsewhere."""

    def __init__(self, rise: float = 0.02, edge: float = 400.0, smooth: float = 5.0) -> None:
        """Set the rise of an edge between every other sample (m), and the stiffness over it and elsewhere, Nm/rad."""
        self.rise, self.edge, self.smooth = rise, edge, smooth

    def decide(self, swing: SwingScan) -> float | None:
        """Return the stiffness by the greatest rise of the scan."""
        if swing.profile is None:
            return None
        z = swing.profile.z
        return self.edge if float((z[2:] - z[:-2]).max(initial=0.0)) > self.rise else self.smooth


register_stiffness_policy("phase", PhasePolicy)
register_stiffness_policy("edge", EdgePolicy)


def main() -> None:
    """Run a study, and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", choices=("phase", "phase_confirmed"))
    parser.add_argument("--journal", type=Path, required=True, help="file that every walk is written to")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seeds", type=int, help="the first so many layouts alone")
    options = parser.parse_args()
    study = Study.from_json(json.loads((STUDIES / f"{options.study}.json").read_text()))
    study = study.narrowed(seeds=options.seeds)
    with Journal(options.journal) as journal:
        sweep([trial.spec for trial in study.trials()], journal, workers=options.workers)
    print(study_table(study, read_journal(options.journal)).markdown())


if __name__ == "__main__":
    main()
