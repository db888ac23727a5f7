"""Base: errors, settings, registries, files and small mathematics, which every room uses.

Nothing here knows of robots or imports another room. What only one room uses stays in that room.
"""
