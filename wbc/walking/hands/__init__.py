"""Hands of a robot that walks: targets that they go to, what they press on or grip, and arms that swing."""
