"""Motion tasks: centre of mass, frames, posture, momentum. A new motion task is a file here."""
