"""Figures from logs and studies. A new one is a module with a drawing function and one line in `FIGURES`.

    figure = draw("balance", [Log.open("walk.arrow")])
    save({"balance": figure}, "balance.png")

`FIGURES` names the ready-made ones; `draw_signals` draws any signal of any log.
"""

from wbc.base.drawing import import_matplotlib

import_matplotlib()
