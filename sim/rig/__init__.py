"""Test rig: press one foot on any ground, and pitch its ankle.

    >>> from wbc.feet import foot
    >>> from wbc.sim import FootTest, press
    >>> from wbc.sim import make_terrain
    >>> test = FootTest(foot("soft", stiffness=5.0), make_terrain("stones", amplitude=0.03, seed=1), load=200.0)
    >>> press(test).hold.contacts
    4

For designers of feet: force balance, contact area, equivalent support polygon, sole shape, loop gap, penetration and
absorbed impact, each a pure function of a frozen `FootTest`. A new test goes into `press.py`, with its result.
"""
