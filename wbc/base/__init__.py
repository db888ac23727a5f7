"""Base: errors, settings, registries, files and small mathematics, which every room uses.

Nothing here knows robots or imports another room. A helper that only one room uses stays in that room.
"""
