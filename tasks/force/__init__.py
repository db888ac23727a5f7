"""Force tasks: contact wrenches, joint torques, and frames that yield to the wrench they measure.

A new force task is a file here.
"""
