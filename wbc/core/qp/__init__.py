"""The quadratic program (QP) of the controller: tasks, contacts, assembly, solver.

motion      rows that follow a motion: what tasks and contacts have in common
task        base of tasks; kinds: those on single coordinates, and on torques and wrenches; options, move: their parts
contact     base of contacts, soles and points; closure: those that hold any wrench; released: joints of somebody else
store       rows of all of them in one QP, of velocities or of accelerations
assembly    the QP of accelerations: dynamics and forces; that of velocities is in `wbc.core.kinematics`
items       base of solvers: what is added and removed; controller: that of the dynamics
solving     problem, solvers and solution; diagnosis: what contradicts, and what holds tasks back

A new kind of task or contact (a base class) goes here; a single task goes into `wbc.tasks`.
"""
