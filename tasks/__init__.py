"""What the controller can want."""
