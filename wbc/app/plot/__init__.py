"""Figures from logs and studies. A new one is a module with a drawing function and one line in `FIGURES`.

    figure = draw("balance", [Log.open("walk.arrow")])
    save({"balance": figure}, "balance.png")

`FIGURES` names the ready-made ones; `draw_signals` draws any signal of any log.
"""

from wbc.app.plot.figures import FIGURES, draw, missing
from wbc.app.plot.output import save
from wbc.app.plot.signals import draw_signals, select

__all__ = ["FIGURES", "draw", "draw_signals", "missing", "save", "select"]
