"""Figures from logs: what a walk looked like in numbers.

    figure = draw("balance", [Log.open("walk.arrow")])
    save({"balance": figure}, "balance.png")

`FIGURES` names the ready-made ones; `draw_signals` draws any signal of any log.
"""

from wbc.app.plot.figures import FIGURES, draw, missing
from wbc.app.plot.output import save
from wbc.app.plot.signals import draw_signals, select

__all__ = ["FIGURES", "draw", "draw_signals", "missing", "save", "select"]
