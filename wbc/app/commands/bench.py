"""`wbc bench`: how fast a tick of the controller is."""

from __future__ import annotations

from wbc.app.bench import BenchTickOptions, bench_tick
from wbc.app.output import Report, reports


@reports
def tick(options: BenchTickOptions) -> Report:
    """Time a tick of the controller: two soles, a swaying centre of mass, posture, joint and torque limits."""
    facts = bench_tick(options)
    parts = ", ".join(f"{name} {value:.1f}" for name, value in facts["parts"].items())
    text = (
        f"{facts['robot']}, {facts['nv']} degrees of freedom, {facts['ticks']} ticks: "
        f"median {facts['median_us']:.1f} us, 99 % below {facts['p99_us']:.1f} us\n"
        f"  {parts}; {facts['failures']} failures, solved by {facts['solvers']}\n"
        f"  centre of mass within {facts['com_error_mm']:.2f} mm, torques up to {100 * facts['torque_use']:.0f} % of "
        f"their limits, {facts['active_limits']:g} limits active, {facts['preempted']} times interrupted"
    )
    return Report(facts, text)
