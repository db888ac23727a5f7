"""State estimation: base pose and velocity from encoders, IMU and foot wrenches."""
