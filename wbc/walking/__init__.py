"""Footsteps, pattern, swing foot, stabilizer law and phases: what turns tasks into a walk."""
