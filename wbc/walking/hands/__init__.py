"""Hands of a robot that walks: their targets, pressing and gripping, and swinging arms."""
