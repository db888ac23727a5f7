"""Free steps, which balance the robot: place and time of each step are decided while the robot goes.

gait                gait: stand, shift and step, and the order of a tick; begin to read here
felt, touch         state of the robot, phase, feet and supported area; contact of the foot in the air
double_support      on both feet: the foot that is to carry, and the shift of the weight
single_support      on one foot: time, place and contact of the foot that swings
decision, program   place, time and centre of pressure of a step, by one quadratic program
path                steps that are asked for: of a velocity, held to a path, or footsteps
law, course         equations of the pendulum and of its orbit; planned motion of the CoM, and the limit on its rise
feet                costs and forces of the feet, which the tasks of the walk write
settings            settings and constants, in units of the robot
"""
