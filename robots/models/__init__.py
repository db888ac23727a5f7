"""Built-in robots, one function each that returns a `RobotDescription`; `wbc.robots.registry` names them."""
