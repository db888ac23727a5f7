"""`wbc bench`: how fast and how reliable the controller is, and what a walk costs."""

from __future__ import annotations

from rich.progress import Progress, track

from wbc.app.bench.profile import profile_text
from wbc.app.bench.solver import BenchSolverOptions, bench_solver
from wbc.app.bench.tick import BenchTickOptions, bench_tick
from wbc.app.bench.walk import CASES, BenchWalkOptions, bench_walk
from wbc.app.output import Flat, Output, OutputOptions, Report, progress_console, reports
from wbc.core.settings import to_json


@reports
def tick(
    options: Flat[BenchTickOptions] = BenchTickOptions(),
    *,
    output: OutputOptions = Output(),
) -> Report:
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
    return output.report(facts, text)


@reports
def solver(
    options: Flat[BenchSolverOptions] = BenchSolverOptions(),
    *,
    output: OutputOptions = Output(),
) -> Report:
    """Solve random problems, check every solution, and compare a sample with ProxQP; 100,000 ticks take minutes."""
    with Progress(console=progress_console()) as bar:
        task = bar.add_task("solving", total=options.ticks)
        facts = bench_solver(options, progress=lambda ticks: bar.update(task, completed=ticks))
    solve, cpu, infeasible = facts["solve_us"], facts["tick_cpu_us"], facts["infeasible"]
    text = (
        f"{facts['ticks']} feasible problems out of {facts['streams']} streams with "
        f"{facts['contact_switches']} contact switches: {facts['unsolved']} unsolved, "
        f"{facts['above_tolerance']} above tolerance (worst residual {facts['worst_residual']:.1e})\n"
        f"  solve, us: {_line(solve)}\n"
        f"  tick, us of processor time: {_line(cpu)}\n"
        f"  {facts['slow_ticks']} ticks over 5 ms; {facts['slow_by_the_clock']} in the first "
        f"run by the clock, pauses of the machine included\n"
        f"  solved by {facts['solvers']}; on average {facts['active_limits']} limits active\n"
        f"  {facts['differ_from_proxqp']} of {facts['compared_with_proxqp']} differ from ProxQP, at most by "
        f"{facts['worst_difference']:.1e} rad/s²; ProxQP failed {facts['proxqp_failed']} times\n"
        f"  beside these, {infeasible['problems']} infeasible problems"
    )
    if infeasible["problems"]:
        text += f", which violate their limits by {infeasible['least_violation']:.2g} and more"
    return output.report(facts, text)


@reports
def walk(
    options: Flat[BenchWalkOptions] = BenchWalkOptions(),
    *,
    output: OutputOptions = Output(),
) -> Report:
    """Time the closed loop of walks, and divide it: physics, observer, stabilizer, QP and the rest."""
    costs = list(track(bench_walk(options), "walking", len(CASES), console=progress_console()))
    texts = [
        f"{cost['name']}: {cost['real_time_factor']:.1f} x real time, {cost['steps_done']} of "
        f"{cost['steps_planned']} steps; of the physics {cost['collision_share']:.0%} collision, "
        f"{cost['constraint_share']:.0%} contact forces\n\n{profile_text(cost['profile'])}"
        for cost in costs
    ]
    return output.report({"rows": to_json(costs)}, "\n\n".join(texts))


def _line(values: dict[str, float]) -> str:
    return ", ".join(f"{share} {value:.0f}" for share, value in values.items())
