"""`wbc feet` and `wbc foot`: the feet, and tests of one foot on a rig."""
