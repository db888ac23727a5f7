"""Robot model, contacts, limits, quadratic program and controller: the floor everything else stands on."""
